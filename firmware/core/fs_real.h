/*
 * The number type of the loops, and integers of known width.
 *
 * float on every target; -DFS_DOUBLE builds the same sources with double on a host, to compare them with Python.
 */
#ifndef FS_REAL_H
#define FS_REAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef FS_DOUBLE
typedef double fs_real;
#define FS_LIT(number) number
#define FS_REAL_MAX 1.7976931348623157e308
#define FS_ROUNDING 1.1102230246251565e-16 /* 2^-53: largest relative error of one operation */
#else
typedef float fs_real;
#define FS_LIT(number) number##F
#define FS_REAL_MAX 3.4028234663852886e38F
#define FS_ROUNDING 5.9604644775390625e-8F /* 2^-24 */
#endif

#define FS_PI FS_LIT(3.141592653589793)

#endif
