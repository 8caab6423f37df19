/* PID attitude control: flightstack/control/attitude_pid.py. */
#ifndef FS_ATTITUDE_PID_H
#define FS_ATTITUDE_PID_H

#include "fs_numbers.h"

/* Torque [N m, FRD]: PID on the angle error, the gyro for its derivative, and feed-forward. Advances the integrals. */
fs_vector3 fs_attitude_pid_step(fs_pid_memory *memory, const fs_attitude_inputs *inputs, const fs_pid_params *params,
                                fs_real dt_s);

#endif
