#include "fs_mixer.h"

#include "fs_math.h"

/*
 * Difference of demanded and achieved [N, N m] that tells a limit from rounding. Python's is the first number
 * alone, far above a double's rounding. With float the sums over the rotors round by more than that: about ten
 * operations on each term, the rounding of the numbers themselves among them, are counted as sixteen.
 */
#define FS_LAG_LEAST FS_LIT(1e-9)
#ifdef FS_DOUBLE
#define FS_LAG_SHARE 0.0
#else
#define FS_LAG_SHARE (16.0F * FS_ROUNDING)
#endif

static fs_real lag(fs_real demanded, fs_real achieved, fs_real sum_of_magnitudes)
{
    const fs_real resolution = FS_LAG_LEAST + FS_LAG_SHARE * sum_of_magnitudes;

    if (demanded - achieved > resolution) {
        return FS_LIT(1.0);
    }
    if (achieved - demanded > resolution) {
        return FS_LIT(-1.0);
    }
    return FS_LIT(0.0);
}

/* Largest k in [0, 1] for which low <= base + k direction <= high holds for every rotor. */
static fs_real largest_scale(const fs_real *base, const fs_real *direction, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real scale = FS_LIT(1.0);
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real step = direction[i];
        const fs_real room = step > FS_LIT(0.0) ? mixer->high[i] - base[i] : mixer->low[i] - base[i];
        if (scale * fs_abs(step) > fs_abs(room)) { /* never where the step is zero */
            scale = fs_max(FS_LIT(0.0), room / step);
        }
    }
    return scale;
}

/*
 * Scale the roll-pitch part so that some thrust brings it between the limits. Rotor i allows the thrusts from (low
 * - b)/a to (high - b)/a, a being its share of a newton: there is a common one when no rotor's least is above
 * another's most.
 */
static void fit_roll_pitch(fs_real *speed_squared, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real scale = FS_LIT(1.0);
    uint16_t i, j;

    for (i = 0U; i < rotors; i++) {
        const fs_real share_i = mixer->allocation[i][0];
        for (j = 0U; j < rotors; j++) {
            const fs_real share_j = mixer->allocation[j][0];
            const fs_real spread = speed_squared[i] * share_j - speed_squared[j] * share_i;
            const fs_real room = mixer->high[i] * share_j - mixer->low[j] * share_i;
            if (spread * scale > room) {
                scale = fs_max(FS_LIT(0.0), room / spread);
            }
        }
    }
    for (i = 0U; i < rotors; i++) {
        speed_squared[i] *= scale;
    }
}

/* The thrusts [N] that keep every rotor within its limits beside the roll-pitch part. */
typedef struct {
    fs_real least, most;
} fs_thrust_range;

static fs_thrust_range thrust_range(const fs_real *base, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real least = -FS_REAL_MAX, most = FS_REAL_MAX;
    fs_thrust_range range;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real per_newton = mixer->allocation[i][0];
        if (per_newton > FS_LIT(0.0)) {
            least = fs_max(least, (mixer->low[i] - base[i]) / per_newton);
            most = fs_min(most, (mixer->high[i] - base[i]) / per_newton);
        }
    }
    range.least = least;
    range.most = most;
    return range;
}

static fs_real signed_root(fs_real square)
{
    return square >= FS_LIT(0.0) ? fs_sqrt(square) : -fs_sqrt(-square);
}

/* Tell what squared speeds of these two parts make, and how far that falls short. */
static void judge(const fs_wrench *wrench, const fs_real *base, const fs_real *yaw, const fs_mixer *mixer,
                  uint16_t rotors, fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    fs_real thrust = FS_LIT(0.0), roll = FS_LIT(0.0), pitch = FS_LIT(0.0), heading = FS_LIT(0.0), sum = FS_LIT(0.0);
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real square = base[i] + yaw[i];
        thrust += mixer->effectiveness[0][i] * square;
        roll += mixer->effectiveness[1][i] * square;
        pitch += mixer->effectiveness[2][i] * square;
        heading += mixer->effectiveness[3][i] * square;
        sum += fs_abs(base[i]) + fs_abs(yaw[i]);
    }
    achieved->thrust_n = thrust;
    achieved->torque_frd_n_m.x = roll;
    achieved->torque_frd_n_m.y = pitch;
    achieved->torque_frd_n_m.z = heading;
    saturation->thrust = lag(wrench->thrust_n, thrust, mixer->largest_effect[0] * sum);
    saturation->torque.x = lag(torque->x, roll, mixer->largest_effect[1] * sum);
    saturation->torque.y = lag(torque->y, pitch, mixer->largest_effect[2] * sum);
    saturation->torque.z = lag(torque->z, heading, mixer->largest_effect[3] * sum);
}

/*
 * Mix where roll and pitch fit whole, and by more than rounding, so that thrust and yaw are limited alone; or return 0.
 * What is made needs no multiplying out there, because effectiveness undoes allocation.
 */
static uint16_t fit_thrust_and_yaw(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors,
                                   fs_real *rotor_speed_rad_s, fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_real roll = wrench->torque_frd_n_m.x, pitch = wrench->torque_frd_n_m.y;
    const fs_real heading = wrench->torque_frd_n_m.z;
    fs_real base[FS_MAX_ROTORS], scale = FS_LIT(1.0), thrust_n;
    fs_thrust_range range;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        base[i] = mixer->allocation[i][1] * roll + mixer->allocation[i][2] * pitch;
    }
    range = thrust_range(base, mixer, rotors);
    if (!(range.most - range.least > FS_LIT(1e-3) * (fs_abs(range.most) + fs_abs(range.least)))) {
        return 0U;
    }
    thrust_n = fs_max(fs_min(wrench->thrust_n, range.most), range.least);
    for (i = 0U; i < rotors; i++) {
        const fs_real low = mixer->low[i], high = mixer->high[i], step = mixer->allocation[i][3] * heading;
        const fs_real lift = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, low), high);
        const fs_real room = step > FS_LIT(0.0) ? high - lift : lift - low, size = fs_abs(step);
        if (scale * size > room) {
            scale = room / size;
        }
        base[i] = lift;
    }
    for (i = 0U; i < rotors; i++) {
        rotor_speed_rad_s[i] = signed_root(base[i] + scale * (mixer->allocation[i][3] * heading));
    }
    *achieved = *wrench;
    achieved->thrust_n = thrust_n;
    achieved->torque_frd_n_m.z = scale * heading;
    saturation->thrust = lag(wrench->thrust_n, thrust_n, mixer->largest_effect[0] * mixer->largest_sum);
    saturation->torque.x = FS_LIT(0.0);
    saturation->torque.y = FS_LIT(0.0);
    saturation->torque.z = lag(heading, achieved->torque_frd_n_m.z, mixer->largest_effect[3] * mixer->largest_sum);
    return 1U;
}

/* Mix where roll and pitch may have to be scaled, or effectiveness does not undo allocation. */
static void fit(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real *rotor_speed_rad_s,
                fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    fs_real base[FS_MAX_ROTORS], yaw[FS_MAX_ROTORS], thrust_n, scale;
    fs_thrust_range range;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
        yaw[i] = mixer->allocation[i][3] * torque->z;
    }
    fit_roll_pitch(base, mixer, rotors);
    range = thrust_range(base, mixer, rotors);
    thrust_n = fs_max(fs_min(wrench->thrust_n, range.most), range.least);
    for (i = 0U; i < rotors; i++) {
        base[i] = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, mixer->low[i]), mixer->high[i]);
    }
    scale = largest_scale(base, yaw, mixer, rotors);
    for (i = 0U; i < rotors; i++) {
        yaw[i] *= scale;
        rotor_speed_rad_s[i] = signed_root(base[i] + yaw[i]);
    }
    judge(wrench, base, yaw, mixer, rotors, achieved, saturation);
}

/* Mix where no rotor comes near a limit, neither with yaw nor without, so that there is nothing to fit; or return 0. */
static uint16_t mix_freely(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real *rotor_speed_rad_s)
{
    const fs_real thrust = wrench->thrust_n, roll = wrench->torque_frd_n_m.x, pitch = wrench->torque_frd_n_m.y;
    const fs_real heading = wrench->torque_frd_n_m.z;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real *share = mixer->allocation[i];
        const fs_real lift = share[1] * roll + share[2] * pitch + share[0] * thrust, turn = share[3] * heading;
        if (!(fs_abs(lift - mixer->middle[i]) + fs_abs(turn) <= mixer->reach[i])) {
            return 0U;
        }
        rotor_speed_rad_s[i] = signed_root(lift + turn);
    }
    return 1U;
}

uint16_t fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors,
                fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_wrench *achieved, fs_saturation *saturation)
{
    uint16_t i;

    for (i = rotors; i < FS_MAX_ROTORS; i++) {
        rotor_speed_rad_s[i] = FS_LIT(0.0);
    }
    if (mixer->is_inverse != 0U) {
        if (mix_freely(wrench, mixer, rotors, rotor_speed_rad_s) != 0U) {
            *achieved = *wrench;
            saturation->thrust = FS_LIT(0.0);
            saturation->torque.x = FS_LIT(0.0);
            saturation->torque.y = FS_LIT(0.0);
            saturation->torque.z = FS_LIT(0.0);
            return 1U;
        }
        if (fit_thrust_and_yaw(wrench, mixer, rotors, rotor_speed_rad_s, achieved, saturation) != 0U) {
            return 0U;
        }
    }
    fit(wrench, mixer, rotors, rotor_speed_rad_s, achieved, saturation);
    return 0U;
}

/* Share of the largest that a sum could be that its rounding may be; the numbers' own errors are in it. */
#ifdef FS_DOUBLE
#define FS_INVERSE_SHARE (1024.0 * FS_ROUNDING)
#else
#define FS_INVERSE_SHARE (16.0F * FS_ROUNDING)
#endif

/* Whether effectiveness times allocation is the identity but for rounding, and every rotor lifts. */
static uint16_t is_inverse(const fs_mixer *mixer, uint16_t rotors)
{
    uint16_t row, column, i;

    for (i = 0U; i < rotors; i++) {
        if (!(mixer->allocation[i][0] > FS_LIT(0.0))) {
            return 0U;
        }
    }
    for (row = 0U; row < 4U; row++) {
        for (column = 0U; column < 4U; column++) {
            fs_real sum = row == column ? FS_LIT(-1.0) : FS_LIT(0.0), magnitude = FS_LIT(0.0);
            for (i = 0U; i < rotors; i++) {
                sum += mixer->effectiveness[row][i] * mixer->allocation[i][column];
                magnitude += fs_abs(mixer->allocation[i][column]);
            }
            if (!(fs_abs(sum) <= FS_INVERSE_SHARE * mixer->largest_effect[row] * magnitude)) {
                return 0U;
            }
        }
    }
    return 1U;
}

void fs_mixer_derive(fs_mixer *mixer, uint16_t rotors)
{
    uint16_t axis, i;

    for (axis = 0U; axis < 4U; axis++) {
        fs_real largest = FS_LIT(0.0);
        for (i = 0U; i < FS_MAX_ROTORS; i++) {
            largest = fs_max(largest, fs_abs(mixer->effectiveness[axis][i]));
        }
        mixer->largest_effect[axis] = largest;
    }
    mixer->largest_sum = FS_LIT(0.0);
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        const fs_real low = mixer->low[i], high = mixer->high[i];
        mixer->middle[i] = FS_LIT(0.5) * low + FS_LIT(0.5) * high;
        mixer->reach[i] = (FS_LIT(0.5) * high - FS_LIT(0.5) * low) -
                          FS_LIT(8.0) * FS_ROUNDING * (fs_abs(low) + fs_abs(high));
        if (i < rotors) {
            mixer->largest_sum += fs_max(fs_abs(low), fs_abs(high));
        }
    }
    mixer->is_inverse = is_inverse(mixer, rotors);
}

fs_real fs_relative_rotor_speed(const fs_real rotor_speed_rad_s[FS_MAX_ROTORS], const fs_mixer *mixer, uint16_t rotors)
{
    fs_real total = FS_LIT(0.0);
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        total -= mixer->spin[i] * rotor_speed_rad_s[i];
    }
    return total;
}
