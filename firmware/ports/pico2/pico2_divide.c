/*
 * Division for Hazard3, which has no floating-point unit: takes the place of the one in zig's run-time library, which cuts
 * off a subnormal quotient where IEEE 754 rounds it to the nearest, ties to even.
 */
#include <stdint.h>

#define SIGN 0x80000000UL
#define INFINITE 0x7F800000UL
#define QUIET_NAN 0x7FC00000UL
#define HIDDEN 0x00800000UL
#define FRACTION 0x007FFFFFUL
#define BIAS 127
#define QUOTIENT_BITS 26U /* two more than a float has */

typedef union {
    float number;
    uint32_t bits;
} word;

float __divsf3(float a, float b);

/* Return the significand of a finite number that is not zero, with its leading bit in HIDDEN, and its exponent. */
static uint32_t normalised(uint32_t bits, int32_t *exponent)
{
    uint32_t significand = bits & FRACTION;

    *exponent = (int32_t)(bits >> 23 & 0xFFU);
    if (*exponent != 0) {
        return significand | HIDDEN;
    }
    *exponent = 1;
    while ((significand & HIDDEN) == 0U) {
        significand <<= 1;
        (*exponent)--;
    }
    return significand;
}

/* Return the quotient of two significands, at least 1, and in its last bit whether something is left over. */
static uint32_t divided(uint32_t rest, uint32_t by)
{
    uint32_t quotient = 0U, n;

    for (n = 0U; n < QUOTIENT_BITS; n++) {
        quotient <<= 1;
        if (rest >= by) {
            rest -= by;
            quotient |= 1U;
        }
        rest <<= 1;
    }
    return quotient << 1 | ((rest != 0U) ? 1U : 0U);
}

static uint32_t shifted_right(uint32_t value, uint32_t places)
{
    if (places > 31U) {
        return 1U;
    }
    return value >> places | (((value & ((1UL << places) - 1U)) != 0U) ? 1U : 0U);
}

/* Divide two finite numbers that are not zero; the signs are ignored. */
static uint32_t divide(uint32_t a, uint32_t b)
{
    int32_t exponent_a, exponent_b, exponent;
    uint32_t top = normalised(a, &exponent_a), below = normalised(b, &exponent_b), quotient, bits;

    exponent = exponent_a - exponent_b + BIAS;
    if (top < below) {
        top <<= 1;
        exponent--;
    }
    if (exponent >= 255) {
        return INFINITE;
    }
    quotient = divided(top, below); /* three bits more than the result */
    if (exponent > 0) {
        bits = ((uint32_t)(exponent - 1) << 23) + (quotient >> 3); /* HIDDEN is the exponent's last bit */
    } else {
        quotient = shifted_right(quotient, (uint32_t)(1 - exponent));
        bits = quotient >> 3;
    }
    return bits + (((quotient & 7U) > 4U || ((quotient & 7U) == 4U && (bits & 1U) != 0U)) ? 1U : 0U);
}

float __divsf3(float a, float b)
{
    word left, right, result;
    uint32_t sign, top, below;

    left.number = a;
    right.number = b;
    sign = (left.bits ^ right.bits) & SIGN;
    top = left.bits & ~SIGN;
    below = right.bits & ~SIGN;
    if (top > INFINITE || below > INFINITE || top + below == 0U || (top == INFINITE && below == INFINITE)) {
        result.bits = QUIET_NAN;
    } else if (top == INFINITE || below == 0U) {
        result.bits = sign | INFINITE;
    } else if (below == INFINITE || top == 0U) {
        result.bits = sign;
    } else {
        result.bits = sign | divide(top, below);
    }
    return result.number;
}
