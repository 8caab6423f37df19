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

/* Thrust nearest to thrust_n that keeps every rotor within its limits beside the roll-pitch part. */
static fs_real fit_thrust(const fs_real *base, fs_real thrust_n, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real least = -FS_REAL_MAX, most = FS_REAL_MAX;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real per_newton = mixer->allocation[i][0];
        if (per_newton > FS_LIT(0.0)) {
            least = fs_max(least, (mixer->low[i] - base[i]) / per_newton);
            most = fs_min(most, (mixer->high[i] - base[i]) / per_newton);
        }
    }
    return fs_max(fs_min(thrust_n, most), least);
}

static void add(fs_wrench *sum, const fs_mixer *mixer, uint16_t rotor, fs_real squared)
{
    sum->thrust_n += mixer->effectiveness[0][rotor] * squared;
    sum->torque_frd_n_m.x += mixer->effectiveness[1][rotor] * squared;
    sum->torque_frd_n_m.y += mixer->effectiveness[2][rotor] * squared;
    sum->torque_frd_n_m.z += mixer->effectiveness[3][rotor] * squared;
}

static void add_magnitudes(fs_wrench *sum, const fs_mixer *mixer, uint16_t rotor, fs_real squared)
{
    sum->thrust_n += fs_abs(mixer->effectiveness[0][rotor]) * squared;
    sum->torque_frd_n_m.x += fs_abs(mixer->effectiveness[1][rotor]) * squared;
    sum->torque_frd_n_m.y += fs_abs(mixer->effectiveness[2][rotor]) * squared;
    sum->torque_frd_n_m.z += fs_abs(mixer->effectiveness[3][rotor]) * squared;
}

void fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
            fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_wrench nothing = {FS_LIT(0.0), {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)}};
    const fs_vector3 *torque = &wrench->torque_frd_n_m, *made = &achieved->torque_frd_n_m;
    fs_real base[FS_MAX_ROTORS], yaw[FS_MAX_ROTORS], thrust_n, scale;
    fs_wrench magnitudes = nothing;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
        yaw[i] = mixer->allocation[i][3] * torque->z;
    }
    fit_roll_pitch(base, mixer, rotors);
    thrust_n = fit_thrust(base, wrench->thrust_n, mixer, rotors);
    for (i = 0U; i < rotors; i++) {
        base[i] = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, mixer->low[i]), mixer->high[i]);
    }
    scale = largest_scale(base, yaw, mixer, rotors);
    *achieved = nothing;
    for (i = 0U; i < rotors; i++) {
        const fs_real part = scale * yaw[i];
        const fs_real squared = base[i] + part;
        rotor_speed_rad_s[i] = squared >= FS_LIT(0.0) ? fs_sqrt(squared) : -fs_sqrt(-squared);
        add(achieved, mixer, i, squared);
        add_magnitudes(&magnitudes, mixer, i, fs_abs(base[i]) + fs_abs(part));
    }
    for (i = rotors; i < FS_MAX_ROTORS; i++) {
        rotor_speed_rad_s[i] = FS_LIT(0.0);
    }
    saturation->thrust = lag(wrench->thrust_n, achieved->thrust_n, magnitudes.thrust_n);
    saturation->torque.x = lag(torque->x, made->x, magnitudes.torque_frd_n_m.x);
    saturation->torque.y = lag(torque->y, made->y, magnitudes.torque_frd_n_m.y);
    saturation->torque.z = lag(torque->z, made->z, magnitudes.torque_frd_n_m.z);
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
