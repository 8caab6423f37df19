/*
 * Functions of Python's math module for laws that are generated from Python: floor, copysign, ldexp, frexp, and tests.
 *
 * Only + - * and comparisons, so that every processor gives the same bits. The core does not use them.
 */
#ifndef FS_LAW_MATH_H
#define FS_LAW_MATH_H

#include "fs_math.h"

#ifdef FS_DOUBLE
#define FS_INFINITY __builtin_inf()
#define FS_NAN __builtin_nan("")
#define FS_LAW_WHOLE 4503599627370496.0 /* 2^52: from here on every number is whole */
#define FS_LAW_EXPONENT 1023
#define FS_LAW_DIGITS 53
#else
#if defined(__GNUC__)
#define FS_INFINITY __builtin_inff()
#define FS_NAN __builtin_nanf("")
#else
#define FS_INFINITY INFINITY
#define FS_NAN NAN
#endif
#define FS_LAW_WHOLE 8388608.0F /* 2^23 */
#define FS_LAW_EXPONENT 127
#define FS_LAW_DIGITS 24
#endif
#define FS_LAW_INT FS_LIT(2147483520.0) /* below 2^31, and a float */

static inline bool fs_is_nan(fs_real value)
{
    return !(fs_abs(value) <= FS_INFINITY);
}

/* The largest whole number that is not above value; +0 for -0, as of Python's integers. */
static inline fs_real fs_floor(fs_real value)
{
    fs_real whole;

    if (!(fs_abs(value) < FS_LAW_WHOLE)) {
        return value;
    }
    whole = value < FS_LIT(0.0) ? (value - FS_LAW_WHOLE) + FS_LAW_WHOLE : (value + FS_LAW_WHOLE) - FS_LAW_WHOLE;
    return whole > value ? whole - FS_LIT(1.0) : whole;
}

/* The magnitude of one number with the sign of another, that of a zero too. */
static inline fs_real fs_copysign(fs_real magnitude, fs_real sign)
{
#if defined(FS_DOUBLE)
    return __builtin_copysign(magnitude, sign);
#elif defined(__GNUC__)
    return __builtin_copysignf(magnitude, sign);
#else
    return copysignf(magnitude, sign);
#endif
}

/* Python's int() of a number below 2^31; the limits beyond, and 0 for NaN. */
static inline int32_t fs_to_int(fs_real value)
{
    if (!(fs_abs(value) < FS_LAW_INT)) {
        return value > FS_LIT(0.0) ? 2147483520 : (value < FS_LIT(0.0) ? -2147483520 : 0);
    }
    return (int32_t)value;
}

/* 2^power, for a power that a normal number has. */
static inline fs_real fs_power_of_two(int32_t power)
{
    fs_real result = FS_LIT(1.0), square = power < 0 ? FS_LIT(0.5) : FS_LIT(2.0);
    int32_t left;

    for (left = power < 0 ? -power : power; left > 0; left /= 2) {
        if (left % 2 == 1) {
            result *= square;
        }
        square *= square;
    }
    return result;
}

/* number 2^power, rounded once. */
static inline fs_real fs_ldexp(fs_real number, int32_t power)
{
    const int32_t step = FS_LAW_EXPONENT - 1;
    fs_real scaled = number;
    int32_t left = power, i;

    for (i = 0; i < 2; i++) {
        if (left > step) {
            scaled *= fs_power_of_two(step);
            left -= step;
        } else if (left < -step) { /* leave the digits above the least number until the last product */
            scaled *= fs_power_of_two(FS_LAW_DIGITS - step);
            left += step - FS_LAW_DIGITS;
        } else {
            break;
        }
    }
    left = left > step ? step : (left < -step ? -step : left);
    return scaled * fs_power_of_two(left);
}

/* number as mantissa 2^power, the mantissa's magnitude in [0.5, 1); power 0 for 0, NaN and infinities. */
static inline void fs_frexp(fs_real number, fs_real *mantissa, int32_t *power)
{
    int32_t exponent = 0, step;
    fs_real size = fs_abs(number);

    if (!(size > FS_LIT(0.0)) || !(size <= FS_REAL_MAX)) {
        *mantissa = number;
        *power = 0;
        return;
    }
    if (size < fs_power_of_two(1 - FS_LAW_EXPONENT)) {
        size *= fs_power_of_two(FS_LAW_DIGITS + 1);
        exponent = -FS_LAW_DIGITS - 1;
    }
    for (step = (FS_LAW_EXPONENT + 1) / 2; step > 0; step /= 2) {
        int32_t shift = 0;
        if (size >= fs_power_of_two(step)) {
            shift = step;
        }
        if (size < fs_power_of_two(1 - step)) {
            shift = -step;
        }
        size *= fs_power_of_two(-shift);
        exponent += shift;
    }
    if (size < FS_LIT(1.0)) {
        size *= FS_LIT(2.0);
        exponent -= 1;
    }
    size *= FS_LIT(0.5);
    *mantissa = number < FS_LIT(0.0) ? -size : size;
    *power = exponent + 1;
}

#endif
