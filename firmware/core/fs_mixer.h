/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Mixer: rotor speeds for a wrench, any rotor set, with limits; priority roll and pitch, then thrust, then yaw.
 * flightstack/control/mixer.py
 */
#ifndef FS_MIXER_H
#define FS_MIXER_H

#include "fs_numbers.h"
#include "fs_types.h"

/* Rotor geometry and limits of n rotors. */
typedef struct {
    int32_t rotors;
    fs_real allocation[FS_MAX_ROTORS][4];
    fs_real effectiveness[4][FS_MAX_ROTORS];
    fs_real low[FS_MAX_ROTORS];
    fs_real high[FS_MAX_ROTORS];
    fs_real spin[FS_MAX_ROTORS];
    fs_real middle[FS_MAX_ROTORS];
    fs_real reach[FS_MAX_ROTORS];
    fs_real is_inverse;
    fs_real is_even;
} fs_mixer;

/* Return Omega_r of the paper: counter-clockwise minus clockwise rotor speeds [rad/s]. mixer.py:275 */
fs_real fs_relative_rotor_speed(const fs_real rotor_speed_rad_s[FS_MAX_ROTORS], const fs_real spin[FS_MAX_ROTORS],
                                int32_t rotors);

/*
 * Write the rotor speeds nearest to wrench; return the wrench that they achieve.
 *
 * rotor_speed_rad_s has at least n elements; work, shape (WORK_ROWS, n), is scratch space. Torque about roll and
 * pitch has priority (it keeps the vehicle upright), then thrust, then yaw. With ideal rotors Omega^2 may be
 * negative: the speed then has its sign.
 *
 * If effectiveness inverts allocation, the achieved wrench follows from the scales without a multiplication.
 *
 * mixer.py:224
 */
fs_wrench fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
                 fs_real work[3][FS_MAX_ROTORS]);

/* Mix without memory; see mix. mixer.py:255 */
void fs_allocation_step(const fs_no_memory *memory, const fs_wrench *wrench, const fs_mixer *rotors_,
                        const fs_no_params *params, fs_real dt_s, fs_real rotor_speed_rad_s[FS_MAX_ROTORS],
                        fs_real work[3][FS_MAX_ROTORS], fs_no_memory *memory_out, fs_wrench *achieved_out);

#endif
