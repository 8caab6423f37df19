/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Mixer: rotor speeds for a wrench, any rotor set, with limits; priority roll and pitch, then thrust, then yaw.
 * flightstack/control/mixer.py
 */
#include "fs_mixer.h"

#include "fs_math.h"

/* mixer.py:275 */
fs_real fs_relative_rotor_speed(const fs_real rotor_speed_rad_s[FS_MAX_ROTORS], const fs_real spin[FS_MAX_ROTORS],
                                int32_t rotors)
{
    fs_real total = FS_LIT(0.0);
    for (int32_t i = 0; i < rotors; i++) {
        total -= spin[i] * rotor_speed_rad_s[i];
    }
    return total;
}

/*
 * Scale the roll-pitch part so that some thrust brings it within the limits; return the scale in [0, 1].
 *
 * Rotor i allows thrusts from (low - b)/a to (high - b)/a, where b is its roll-pitch part and a its Omega^2 per
 * newton. A common thrust exists if no rotor's minimum exceeds another's maximum; a > 0 for any vehicle that hovers.
 *
 * mixer.py:166
 */
static fs_real fit_roll_pitch(fs_real speed_squared[FS_MAX_ROTORS], const fs_mixer *mixer)
{
    fs_real scale = FS_LIT(1.0);
    const int32_t n = mixer->rotors;
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j < n; j++) {
            const fs_real share_i = mixer->allocation[i][0];
            const fs_real share_j = mixer->allocation[j][0];
            const fs_real spread = speed_squared[i] * share_j - speed_squared[j] * share_i;
            const fs_real room = mixer->high[i] * share_j - mixer->low[j] * share_i;
            if (spread * scale > room) {
                scale = fs_max(FS_LIT(0.0), room / spread);
            }
        }
    }
    for (int32_t i = 0; i < n; i++) {
        speed_squared[i] *= scale;
    }
    return scale;
}

/*
 * Return the thrust nearest to thrust_n that keeps every rotor, with its roll-pitch part, within its limits.
 * mixer.py:187
 */
static fs_real fit_thrust(const fs_real base[FS_MAX_ROTORS], fs_real thrust_n, const fs_mixer *mixer)
{
    fs_real new_thrust_n = thrust_n;
    for (int32_t i = 0; i < mixer->rotors; i++) {
        if (mixer->allocation[i][0] > FS_LIT(0.0)) {
            new_thrust_n = fs_min(new_thrust_n, (mixer->high[i] - base[i]) / mixer->allocation[i][0]);
        }
    }
    for (int32_t i = 0; i < mixer->rotors; i++) {
        if (mixer->allocation[i][0] > FS_LIT(0.0)) {
            new_thrust_n = fs_max(new_thrust_n, (mixer->low[i] - base[i]) / mixer->allocation[i][0]);
        }
    }
    return new_thrust_n;
}

/* Return the largest k in [0, 1] for which low <= base + k*direction <= high holds for every rotor. mixer.py:154 */
static fs_real largest_scale(const fs_real base[FS_MAX_ROTORS], const fs_real direction[FS_MAX_ROTORS],
                             const fs_real low[FS_MAX_ROTORS], const fs_real high[FS_MAX_ROTORS], int32_t rotors)
{
    fs_real scale = FS_LIT(1.0);
    for (int32_t i = 0; i < rotors; i++) {
        const fs_real step = direction[i];
        const fs_real room = step > FS_LIT(0.0) ? high[i] - base[i] : low[i] - base[i];
        if (scale * fs_abs(step) > fs_abs(room)) { /* never if the step is zero */
            scale = fs_max(FS_LIT(0.0), room / step);
        }
    }
    return scale;
}

/* mixer.py:148 */
static fs_real signed_root(fs_real square)
{
    const fs_real root = fs_sqrt(fs_abs(square));
    return square >= FS_LIT(0.0) ? root : -root;
}

/* Mix for rotors that differ, or if effectiveness does not invert allocation. mixer.py:199 */
static fs_wrench fit(const fs_wrench *wrench, const fs_mixer *mixer, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
                     fs_real work[3][FS_MAX_ROTORS])
{
    const int32_t n = mixer->rotors;
    fs_real *base = work[0];
    fs_real *yaw = work[1];
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    for (int32_t i = 0; i < n; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
        yaw[i] = mixer->allocation[i][3] * torque->z;
    }
    (void)fit_roll_pitch(base, mixer);
    const fs_real thrust_n = fit_thrust(base, wrench->thrust_n, mixer);
    for (int32_t i = 0; i < n; i++) {
        base[i] = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, mixer->low[i]), mixer->high[i]);
    }
    const fs_real scale = largest_scale(base, yaw, mixer->low, mixer->high, mixer->rotors);
    fs_real total = FS_LIT(0.0);
    fs_real roll = FS_LIT(0.0);
    fs_real pitch = FS_LIT(0.0);
    fs_real heading = FS_LIT(0.0);
    for (int32_t i = 0; i < n; i++) {
        const fs_real squared = base[i] + scale * yaw[i];
        rotor_speed_rad_s[i] = signed_root(squared);
        total += mixer->effectiveness[0][i] * squared;
        roll += mixer->effectiveness[1][i] * squared;
        pitch += mixer->effectiveness[2][i] * squared;
        heading += mixer->effectiveness[3][i] * squared;
    }
    return (fs_wrench){
        .thrust_n = total,
        .torque_frd_n_m = {roll, pitch, heading},
    };
}

/*
 * Write each rotor's part of roll and pitch, of yaw, and of roll, pitch and thrust, without limits.
 *
 * Return two flags: no rotor is near a limit; a rotor is at or beyond a limit even without yaw.
 *
 * mixer.py:93
 */
static void allocate(const fs_wrench *wrench, const fs_mixer *mixer, fs_real work[3][FS_MAX_ROTORS],
                     bool *is_free_out, bool *is_thrust_limited_out)
{
    fs_real *base = work[0];
    fs_real *turn = work[1];
    fs_real *lift = work[2];
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    bool is_free = true;
    bool is_thrust_limited = false;
    for (int32_t i = 0; i < mixer->rotors; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
        turn[i] = mixer->allocation[i][3] * torque->z;
        lift[i] = base[i] + mixer->allocation[i][0] * wrench->thrust_n;
        const fs_real off = fs_abs(lift[i] - mixer->middle[i]);
        if (!(off + fs_abs(turn[i]) <= mixer->reach[i])) {
            is_free = false;
            if (!(off <= mixer->reach[i])) {
                is_thrust_limited = true;
            }
        }
    }
    *is_free_out = is_free;
    *is_thrust_limited_out = is_thrust_limited;
}

/*
 * Limit roll and pitch, then thrust, for identical rotors; return the scale of roll and pitch, and the thrust.
 *
 * The rotors with the largest and the smallest part of roll and pitch determine both.
 *
 * mixer.py:113
 */
static void limit_even(fs_real thrust_n, const fs_mixer *mixer, fs_real work[3][FS_MAX_ROTORS], fs_real *scale_out,
                       fs_real *thrust_n_out)
{
    fs_real *base = work[0];
    fs_real *lift = work[2];
    const fs_real share = mixer->allocation[0][0];
    const fs_real low = mixer->low[0];
    const fs_real high = mixer->high[0];
    fs_real upper = base[0];
    fs_real lower = base[0];
    for (int32_t i = 1; i < mixer->rotors; i++) {
        upper = fs_max(upper, base[i]);
        lower = fs_min(lower, base[i]);
    }
    fs_real scale = FS_LIT(1.0);
    if (upper - lower > high - low) {
        scale = (high - low) / (upper - lower);
        upper *= scale;
        lower *= scale;
    }
    const fs_real new_thrust_n = fs_max(fs_min(thrust_n, (high - upper) / share), (low - lower) / share);
    for (int32_t i = 0; i < mixer->rotors; i++) {
        /* beyond by no more than rounding */
        lift[i] = fs_min(fs_max(base[i] * scale + share * new_thrust_n, low), high);
    }
    *scale_out = scale;
    *thrust_n_out = new_thrust_n;
}

/* Return the share of yaw, in [0, 1], that fits within the limits. mixer.py:135 */
static fs_real largest_yaw_scale(const fs_mixer *mixer, const fs_real work[3][FS_MAX_ROTORS])
{
    const fs_real *turn = work[1];
    const fs_real *lift = work[2];
    fs_real scale = FS_LIT(1.0);
    for (int32_t i = 0; i < mixer->rotors; i++) {
        const fs_real room = turn[i] > FS_LIT(0.0) ? mixer->high[i] - lift[i] : lift[i] - mixer->low[i];
        const fs_real size = fs_abs(turn[i]);
        if (scale * size > room) {
            scale = room / size;
        }
    }
    return scale;
}

/* mixer.py:224 */
fs_wrench fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
                 fs_real work[3][FS_MAX_ROTORS])
{
    if (mixer->is_inverse == FS_LIT(0.0)) {
        return fit(wrench, mixer, rotor_speed_rad_s, work);
    }
    bool is_free;
    bool is_thrust_limited;
    allocate(wrench, mixer, work, &is_free, &is_thrust_limited);
    fs_real tilt_scale = FS_LIT(1.0);
    fs_real thrust_n = wrench->thrust_n;
    fs_real yaw_scale = FS_LIT(1.0);
    if (!is_free) {
        if (is_thrust_limited) {
            if (mixer->is_even == FS_LIT(0.0)) {
                return fit(wrench, mixer, rotor_speed_rad_s, work);
            }
            limit_even(thrust_n, mixer, work, &tilt_scale, &thrust_n);
        }
        yaw_scale = largest_yaw_scale(mixer, (const fs_real(*)[FS_MAX_ROTORS])work);
    }
    for (int32_t i = 0; i < mixer->rotors; i++) {
        rotor_speed_rad_s[i] = signed_root(work[2][i] + yaw_scale * work[1][i]);
    }
    if (is_free) {
        return *wrench;
    }
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    fs_real roll = torque->x;
    fs_real pitch = torque->y;
    if (tilt_scale < FS_LIT(1.0)) {
        roll = tilt_scale * roll;
        pitch = tilt_scale * pitch;
    }
    return (fs_wrench){
        .thrust_n = thrust_n,
        .torque_frd_n_m = {roll, pitch, yaw_scale * torque->z},
    };
}

/* mixer.py:255 */
void fs_allocation_step(const fs_no_memory *memory, const fs_wrench *wrench, const fs_mixer *rotors_,
                        const fs_no_params *params, fs_real dt_s, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
                        fs_real work[3][FS_MAX_ROTORS], fs_no_memory *memory_out, fs_wrench *achieved_out)
{
    (void)params;
    (void)dt_s;
    const fs_wrench achieved = fs_mix(wrench, rotors_, rotor_speed_rad_s, work);
    *memory_out = *memory;
    *achieved_out = achieved;
}
