/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Elementary functions and Euler angles with bit-identical results on every processor, built from + - x ? and sqrt
 * alone. flightstack/core/portable_math.py
 */
#include "fs_portable_math.h"

#include "fs_math.h"

/* portable_math.py:66 */
fs_real fs_tan(fs_real angle_rad)
{
    fs_real sine;
    fs_real cosine;
    fs_sin_cos(angle_rad, &sine, &cosine);
    return sine / cosine;
}
