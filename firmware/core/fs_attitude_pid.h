/* PID attitude control: flightstack/control/attitude_pid.py. */
#ifndef FS_ATTITUDE_PID_H
#define FS_ATTITUDE_PID_H

#include "fs_numbers.h"

/* Torque [N m, FRD]: PID on the angle error, the gyro for its derivative, and feed-forward. Advances the integrals. */
fs_vector3 fs_attitude_pid_step(fs_pid_memory *memory, const fs_vector3 *error_rad, const fs_vector3 *rates_frd_rad_s,
                                const fs_attitude_reference *reference, const fs_vector3 *saturation,
                                const fs_pid_params *params, fs_real dt_s);

#endif
