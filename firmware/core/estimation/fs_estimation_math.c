/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Elementary functions and Euler angles with bit-identical results on every processor, built from + - x ? and sqrt
 * alone. flightstack/core/portable_math.py
 */
#include "fs_estimation_math.h"

#include "fs_law_math.h"
#include "fs_math.h"

#define FS_LARGEST_SQUARE FS_LIT(0.1715)
#define FS_HALF_PI FS_LIT(1.5707963267948966)
#define FS_HALF_PI_REST FS_LIT(6.123233995736766e-17)
#define FS_LN2_1 FS_LIT(0.6931471803691238)
#define FS_LN2_2 FS_LIT(1.9082149292705877e-10)
#define FS_LARGEST_EXPONENT FS_LIT(709.78)
#define FS_LEAST_EXPONENT FS_LIT(-745.2)

/* portable_math.py:89 */
fs_real fs_atan2(fs_real y, fs_real x)
{
    if (fs_is_nan(x + y)) {
        return FS_NAN;
    }
    const fs_real width = fs_abs(x);
    const fs_real height = fs_abs(y);
    fs_real ratio = FS_LIT(0.0);
    if (width != height) {
        ratio = height < width ? height / width : width / height;
    } else {
        if (width > FS_LIT(0.0)) {
            ratio = FS_LIT(1.0);
        }
    }
    const fs_real square = ratio * ratio;
    fs_real angle;
    if (square < FS_LARGEST_SQUARE) {
        angle = ratio + ratio * fs_arc_tangent_series(square);
    } else {
        /* tan(a/2) = tan a / (1 + sqrt(1 + tan^2 a)) */
        const fs_real half = ratio / (FS_LIT(1.0) + fs_sqrt(FS_LIT(1.0) + square));
        angle = FS_LIT(2.0) * (half + half * fs_arc_tangent_series(half * half));
    }
    if (height > width) {
        angle = FS_HALF_PI - (angle - FS_HALF_PI_REST);
    }
    if (fs_copysign(FS_LIT(1.0), x) < FS_LIT(0.0)) {
        angle = FS_LIT(2.0) * FS_HALF_PI - (angle - FS_LIT(2.0) * FS_HALF_PI_REST);
    }
    return fs_copysign(angle, y);
}

/* portable_math.py:147 */
fs_real fs_log(fs_real number)
{
    fs_real mantissa_2;
    int32_t power_2;
    fs_frexp(number, &mantissa_2, &power_2);
    fs_real mantissa = mantissa_2;
    int32_t power = power_2;
    if (mantissa < FS_LIT(0.7071067811865476)) {
        mantissa = FS_LIT(2.0) * mantissa;
        power = power - 1;
    }
    /* ln m = 2 artanh t, t = (m - 1)/(m + 1), up to 0.172 */
    const fs_real ratio = (mantissa - FS_LIT(1.0)) / (mantissa + FS_LIT(1.0));
    const fs_real square = ratio * ratio;
    fs_real series = FS_LIT(1.0) / FS_LIT(21.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(19.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(17.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(15.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(13.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(11.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(9.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(7.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(5.0);
    series = series * square + FS_LIT(1.0) / FS_LIT(3.0);
    return (fs_real)power * FS_LN2_1 + (FS_LIT(2.0) * ratio +
                                        (FS_LIT(2.0) * ratio * (square * series) + (fs_real)power * FS_LN2_2));
}

/* portable_math.py:122 */
fs_real fs_exp(fs_real exponent)
{
    if (fs_is_nan(exponent)) {
        return FS_NAN;
    }
    if (exponent > FS_LARGEST_EXPONENT) {
        return FS_INFINITY;
    }
    if (exponent < FS_LEAST_EXPONENT) {
        return FS_LIT(0.0);
    }
    const fs_real power = fs_floor(exponent * FS_LIT(1.4426950408889634) + FS_LIT(0.5)); /* 1/ln 2 */
    const fs_real rest = exponent - power * FS_LN2_1 - power * FS_LN2_2;
    fs_real series = FS_LIT(1.0) / FS_LIT(6227020800.0); /* 1/13! */
    series = series * rest + FS_LIT(1.0) / FS_LIT(479001600.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(39916800.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(3628800.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(362880.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(40320.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(5040.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(720.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(120.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(24.0);
    series = series * rest + FS_LIT(1.0) / FS_LIT(6.0);
    series = series * rest + FS_LIT(0.5);
    return fs_ldexp(FS_LIT(1.0) + (rest + rest * rest * series), fs_to_int(power));
}
