/* From a wrench to rotor speeds, for any rotor set, with limits: roll and pitch before thrust before yaw. */
#ifndef FS_MIXER_H
#define FS_MIXER_H

#include "fs_types.h"

#define FS_LEAST_ROTORS 4U

/* What the mixer needs of one rotor in each tick, side by side: its row of allocation, and its limits. */
typedef struct {
    fs_real share[4];
    fs_real low, high;
    fs_real middle; /* between low and high */
    fs_real reach;  /* from there to either, less some rounding */
} fs_rotor;

/*
 * Rotor geometry in the form that the mixer computes with.
 *
 * allocation maps (thrust [N], torque FRD [N m]) to squared speeds [rad^2/s^2]; effectiveness maps back. low and
 * high bound squared speeds, and are of either sign with ideal rotors. spin is +1 for a rotor that turns clockwise
 * from above.
 */
typedef struct {
    fs_real allocation[FS_MAX_ROTORS][4];
    fs_real effectiveness[4][FS_MAX_ROTORS];
    fs_real low[FS_MAX_ROTORS];
    fs_real high[FS_MAX_ROTORS];
    fs_real spin[FS_MAX_ROTORS];
    /* what follows from these, by fs_mixer_derive */
    fs_rotor rotor[FS_MAX_ROTORS];
    fs_real largest_effect[4];     /* of any rotor, for each row of effectiveness */
    fs_real resolution[4];         /* [N, N m] difference in each row that tells a limit from rounding */
    uint16_t is_inverse;           /* 1: effectiveness undoes allocation but for rounding, and every rotor lifts */
    uint16_t is_even;              /* 1: all rotors have the same limits and the same share of the thrust */
} fs_mixer;

/* What the mixer could not follow of thrust [N] and torque [N m]: negative where it made more than demanded. */
typedef struct {
    fs_real thrust;
    fs_vector3 torque;
} fs_saturation;

/*
 * Write the rotor speeds [rad/s] that come nearest to the wrench, the wrench that they make, and where the two
 * differ by more than the rounding of the sums.
 *
 * Torque about roll and pitch is served first (they keep the vehicle upright), then thrust, then yaw with what is
 * left. With ideal rotors a squared speed may be negative: the speed then carries the sign. Speeds beyond the
 * rotors, of which there are at least FS_LEAST_ROTORS, become zero. Return the FS_STATUS_* bits of the saturation, or
 * FS_STATUS_OUTPUT_NOT_FINITE alone: then nothing of what was written is to be used.
 */
uint16_t fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors,
                fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_wrench *achieved, fs_saturation *saturation);

/* Make what follows from the other numbers of a mixer, after one of them or the number of rotors was changed. */
void fs_mixer_derive(fs_mixer *mixer, uint16_t rotors);

/* Omega_r of the paper: counter-clockwise minus clockwise rotor speeds [rad/s]. */
fs_real fs_relative_rotor_speed(const fs_real rotor_speed_rad_s[FS_MAX_ROTORS], const fs_mixer *mixer, uint16_t rotors);

#endif
