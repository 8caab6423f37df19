/* Smooth the attitude target and differentiate it: flightstack/control/attitude_reference.py. */
#ifndef FS_ATTITUDE_REFERENCE_H
#define FS_ATTITUDE_REFERENCE_H

#include "fs_numbers.h"

/*
 * Advance the reference by dt_s towards the target; rates and acceleration come in the reference's own body frame.
 * next may be memory itself.
 */
void fs_attitude_reference_step(const fs_reference_memory *memory, const fs_quaternion *target,
                                const fs_reference_params *params, fs_real dt_s, fs_reference_memory *next,
                                fs_attitude_reference *reference);

/*
 * Turn the reference's rates and acceleration from its own body frame into that of a vehicle at this attitude;
 * return the rotation from the vehicle to the reference.
 */
fs_quaternion fs_in_body_frame(fs_attitude_reference *reference, const fs_quaternion *attitude);

#endif
