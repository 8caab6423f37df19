/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Elementary functions and Euler angles with bit-identical results on every processor, built from + - x ? and sqrt
 * alone. flightstack/core/portable_math.py
 */
#ifndef FS_PORTABLE_MATH_H
#define FS_PORTABLE_MATH_H

#include "fs_types.h"

/* Return the tangent, within 3 ulp within one turn; see sin_cos. portable_math.py:66 */
fs_real fs_tan(fs_real angle_rad);

#endif
