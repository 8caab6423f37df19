/* Limits of the mixer: what follows from a rotor set, and what the rotors could not follow of a wrench. */
#ifndef FS_MIXER_LIMITS_H
#define FS_MIXER_LIMITS_H

#include "fs_mixer.h"

/* What the mixer could not follow of thrust [N] and torque [N m]: negative where it made more than demanded. */
typedef struct {
    fs_real thrust;
    fs_vector3 torque;
} fs_saturation;

/* Difference [N, N m] of thrust, roll, pitch and yaw that tells a limit from rounding. */
typedef struct {
    fs_real thrust, roll, pitch, yaw;
} fs_resolution;

/* Make what follows from the other numbers of a mixer, after one of them or the number of rotors was changed. */
void fs_mixer_derive(fs_mixer *mixer, uint16_t rotors, fs_resolution *resolution);

/* Write where the achieved wrench differs from the demanded one by more than rounding; return the FS_STATUS_* bits. */
uint16_t fs_saturation_of(const fs_wrench *demanded, const fs_wrench *achieved, const fs_resolution *resolution,
                          fs_saturation *saturation);

#endif
