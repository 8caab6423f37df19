/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Elementary functions and Euler angles with bit-identical results on every processor, built from + - x ? and sqrt
 * alone. flightstack/core/portable_math.py
 */
#ifndef FS_ESTIMATION_MATH_H
#define FS_ESTIMATION_MATH_H

#include "fs_types.h"

/*
 * Return the angle of the point (x, y) from the x axis, in [-pi, pi], within 3 ulp; 0 for the origin.
 * portable_math.py:89
 */
fs_real fs_atan2(fs_real y, fs_real x);

/* Return the natural logarithm of a positive, finite number, within 2 ulp. portable_math.py:147 */
fs_real fs_log(fs_real number);

/* Return e to the power of exponent, within 1 ulp; NaN for NaN. portable_math.py:122 */
fs_real fs_exp(fs_real exponent);

#endif
