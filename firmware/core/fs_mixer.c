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
        if (step != FS_LIT(0.0) && scale * fs_abs(step) > fs_abs(room)) {
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
    uint16_t is_sure; /* there are such thrusts, and by more than rounding, so that roll and pitch need no scaling */
} fs_thrust_range;

static fs_thrust_range thrust_range(const fs_real *base, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real least = -FS_REAL_MAX, most = FS_REAL_MAX;
    uint16_t all_lift = 1U, i;
    fs_thrust_range range;

    for (i = 0U; i < rotors; i++) {
        const fs_real per_newton = mixer->allocation[i][0];
        if (per_newton > FS_LIT(0.0)) {
            least = fs_max(least, (mixer->low[i] - base[i]) / per_newton);
            most = fs_min(most, (mixer->high[i] - base[i]) / per_newton);
        } else {
            all_lift = 0U;
        }
    }
    range.least = least;
    range.most = most;
    range.is_sure = (all_lift && most - least > FS_LIT(1e-3) * (fs_abs(most) + fs_abs(least))) ? 1U : 0U;
    return range;
}

/* The wrench that squared speeds make, and the sum of the magnitudes that they are sums of. */
typedef struct {
    fs_wrench wrench;
    fs_real magnitude;
} fs_made;

/* Add yaw's part, turn squared speeds into speeds, zero beyond the rotors, and tell what they make. */
static fs_made speeds_and_wrench(const fs_real *base, const fs_real *yaw, fs_real scale, const fs_mixer *mixer,
                                 uint16_t rotors, fs_real *rotor_speed_rad_s)
{
    fs_real thrust = FS_LIT(0.0), roll = FS_LIT(0.0), pitch = FS_LIT(0.0), heading = FS_LIT(0.0), sum = FS_LIT(0.0);
    fs_made made;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real part = scale * yaw[i];
        const fs_real square = base[i] + part;
        rotor_speed_rad_s[i] = square >= FS_LIT(0.0) ? fs_sqrt(square) : -fs_sqrt(-square);
        thrust += mixer->effectiveness[0][i] * square;
        roll += mixer->effectiveness[1][i] * square;
        pitch += mixer->effectiveness[2][i] * square;
        heading += mixer->effectiveness[3][i] * square;
        sum += fs_abs(base[i]) + fs_abs(part);
    }
    for (i = rotors; i < FS_MAX_ROTORS; i++) {
        rotor_speed_rad_s[i] = FS_LIT(0.0);
    }
    made.wrench.thrust_n = thrust;
    made.wrench.torque_frd_n_m.x = roll;
    made.wrench.torque_frd_n_m.y = pitch;
    made.wrench.torque_frd_n_m.z = heading;
    made.magnitude = sum;
    return made;
}

/*
 * Write what thrust, roll and pitch ask of each rotor, [rad^2/s^2], and what yaw does; return 1 when that is within
 * the limits of every rotor, with yaw and without. Then there is nothing to fit: fit() would change nothing, in
 * three times the time.
 */
static uint16_t demand(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real *base, fs_real *yaw)
{
    uint16_t fits = 1U;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real *share = mixer->allocation[i];
        const fs_real roll_pitch = share[1] * wrench->torque_frd_n_m.x + share[2] * wrench->torque_frd_n_m.y;
        const fs_real lift = roll_pitch + share[0] * wrench->thrust_n;
        const fs_real turn = share[3] * wrench->torque_frd_n_m.z;
        const fs_real all = lift + turn, low = mixer->low[i], high = mixer->high[i];
        if (!(share[0] > FS_LIT(0.0) && lift >= low && lift <= high && all >= low && all <= high)) {
            fits = 0U;
        }
        base[i] = lift;
        yaw[i] = turn;
    }
    return fits;
}

/* Bring thrust, roll and pitch between the limits, into base; return the share of yaw that fits beside them. */
static fs_real fit(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real *base, const fs_real *yaw)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    fs_thrust_range range;
    fs_real thrust_n;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
    }
    range = thrust_range(base, mixer, rotors);
    if (!range.is_sure) {
        fit_roll_pitch(base, mixer, rotors);
        range = thrust_range(base, mixer, rotors);
    }
    thrust_n = fs_max(fs_min(wrench->thrust_n, range.most), range.least);
    for (i = 0U; i < rotors; i++) {
        base[i] = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, mixer->low[i]), mixer->high[i]);
    }
    return largest_scale(base, yaw, mixer, rotors);
}

void fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
            fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m, *made = &achieved->torque_frd_n_m;
    fs_real base[FS_MAX_ROTORS], yaw[FS_MAX_ROTORS], scale = FS_LIT(1.0);
    fs_made sums;

    if (!demand(wrench, mixer, rotors, base, yaw)) {
        scale = fit(wrench, mixer, rotors, base, yaw);
    }
    sums = speeds_and_wrench(base, yaw, scale, mixer, rotors, rotor_speed_rad_s);
    *achieved = sums.wrench;
    saturation->thrust = lag(wrench->thrust_n, achieved->thrust_n, mixer->largest_effect[0] * sums.magnitude);
    saturation->torque.x = lag(torque->x, made->x, mixer->largest_effect[1] * sums.magnitude);
    saturation->torque.y = lag(torque->y, made->y, mixer->largest_effect[2] * sums.magnitude);
    saturation->torque.z = lag(torque->z, made->z, mixer->largest_effect[3] * sums.magnitude);
}

void fs_mixer_derive(fs_mixer *mixer)
{
    uint16_t axis, i;

    for (axis = 0U; axis < 4U; axis++) {
        fs_real largest = FS_LIT(0.0);
        for (i = 0U; i < FS_MAX_ROTORS; i++) {
            largest = fs_max(largest, fs_abs(mixer->effectiveness[axis][i]));
        }
        mixer->largest_effect[axis] = largest;
    }
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
