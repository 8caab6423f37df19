#include "fs_mixer_limits.h"

#include "fs_math.h"

/*
 * Difference of demanded and achieved [N, N m] that tells a limit from rounding. Python's is the first number
 * alone, far above a double's rounding. With float the sums over the rotors round by more than that: about ten
 * operations on each term, the rounding of the numbers themselves among them, are counted as sixteen.
 */
#define FS_LAG_LEAST FS_LIT(1e-9)
#ifdef FS_DOUBLE
#define FS_LAG_SHARE 0.0
#define FS_INVERSE_SHARE (1024.0 * FS_ROUNDING) /* of the largest that a sum could be: its rounding */
#else
#define FS_LAG_SHARE (16.0F * FS_ROUNDING)
#define FS_INVERSE_SHARE (16.0F * FS_ROUNDING)
#endif

/* How far achieved lags behind demanded, zero within the resolution; the bit tells that it is not. */
static fs_real lag(fs_real demanded, fs_real achieved, fs_real resolution, uint16_t bit, uint16_t *bits)
{
    const fs_real behind = demanded - achieved;

    if (fs_abs(behind) <= resolution) {
        return FS_LIT(0.0);
    }
    *bits |= bit;
    return behind;
}

uint16_t fs_saturation_of(const fs_wrench *demanded, const fs_wrench *achieved, const fs_resolution *resolution,
                          fs_saturation *saturation)
{
    const fs_vector3 *wanted = &demanded->torque_frd_n_m, *made = &achieved->torque_frd_n_m;
    uint16_t bits = 0U;

    saturation->thrust =
        lag(demanded->thrust_n, achieved->thrust_n, resolution->thrust, FS_STATUS_THRUST_SATURATED, &bits);
    saturation->torque.x = lag(wanted->x, made->x, resolution->roll, FS_STATUS_ROLL_SATURATED, &bits);
    saturation->torque.y = lag(wanted->y, made->y, resolution->pitch, FS_STATUS_PITCH_SATURATED, &bits);
    saturation->torque.z = lag(wanted->z, made->z, resolution->yaw, FS_STATUS_YAW_SATURATED, &bits);
    return bits;
}

/* Largest effect of a rotor on thrust, roll, pitch or yaw. */
static fs_real largest_effect(const fs_mixer *mixer, uint16_t row)
{
    fs_real largest = FS_LIT(0.0);
    uint16_t i;

    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        largest = fs_max(largest, fs_abs(mixer->effectiveness[row][i]));
    }
    return largest;
}

/* Whether effectiveness times allocation is the identity but for rounding, and every rotor lifts. */
static bool is_inverse(const fs_mixer *mixer, uint16_t rotors)
{
    uint16_t row, column, i;

    for (i = 0U; i < rotors; i++) {
        if (!(mixer->allocation[i][0] > FS_LIT(0.0))) {
            return false;
        }
    }
    for (row = 0U; row < 4U; row++) {
        for (column = 0U; column < 4U; column++) {
            fs_real sum = row == column ? FS_LIT(-1.0) : FS_LIT(0.0), magnitude = FS_LIT(0.0);
            for (i = 0U; i < rotors; i++) {
                sum += mixer->effectiveness[row][i] * mixer->allocation[i][column];
                magnitude += fs_abs(mixer->allocation[i][column]);
            }
            if (!(fs_abs(sum) <= FS_INVERSE_SHARE * largest_effect(mixer, row) * magnitude)) {
                return false;
            }
        }
    }
    return true;
}

/* Whether two numbers are the same but for rounding. */
static bool is_same(fs_real a, fs_real b)
{
    return fs_abs(a - b) <= FS_LIT(16.0) * FS_ROUNDING * fs_abs(a);
}

/* Whether all rotors have the same limits and the same share of the thrust. */
static bool is_even(const fs_mixer *mixer, uint16_t rotors)
{
    uint16_t i;

    for (i = 1U; i < rotors; i++) {
        if (!is_same(mixer->allocation[0][0], mixer->allocation[i][0]) || !is_same(mixer->low[0], mixer->low[i]) ||
            !is_same(mixer->high[0], mixer->high[i])) {
            return false;
        }
    }
    return true;
}

void fs_mixer_derive(fs_mixer *mixer, uint16_t rotors, fs_resolution *resolution)
{
    fs_real share = FS_LIT(0.0);
    uint16_t i;

    mixer->rotors = (int32_t)rotors;
    for (i = 0U; i < rotors; i++) {
        const fs_real low = mixer->low[i], high = mixer->high[i];
        mixer->middle[i] = FS_LIT(0.5) * low + FS_LIT(0.5) * high;
        mixer->reach[i] = (FS_LIT(0.5) * high - FS_LIT(0.5) * low) -
                          FS_LIT(8.0) * FS_ROUNDING * (fs_abs(low) + fs_abs(high));
        share += fs_max(fs_abs(low), fs_abs(high));
    }
    share *= FS_LAG_SHARE;
    resolution->thrust = FS_LAG_LEAST + share * largest_effect(mixer, 0U);
    resolution->roll = FS_LAG_LEAST + share * largest_effect(mixer, 1U);
    resolution->pitch = FS_LAG_LEAST + share * largest_effect(mixer, 2U);
    resolution->yaw = FS_LAG_LEAST + share * largest_effect(mixer, 3U);
    mixer->is_inverse = is_inverse(mixer, rotors) ? FS_LIT(1.0) : FS_LIT(0.0);
    mixer->is_even = is_even(mixer, rotors) ? FS_LIT(1.0) : FS_LIT(0.0);
}
