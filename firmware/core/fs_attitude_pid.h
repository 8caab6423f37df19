/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* PID attitude control, the paper's inner loop (section II.B.1). flightstack/control/attitude_pid.py */
#ifndef FS_ATTITUDE_PID_H
#define FS_ATTITUDE_PID_H

#include "fs_numbers.h"
#include "fs_types.h"

/* Integrate error unless the actuators are saturated in its direction (anti-windup). attitude_pid.py:58 */
fs_real fs_integrated(fs_real integral, fs_real error, fs_real saturation, fs_real dt_s);

/*
 * Return the torque [N m, FRD]: PID on the angle error, with the rate error as derivative, and feed-forward.
 * attitude_pid.py:64
 */
void fs_attitude_pid_step(const fs_pid_memory *memory, const fs_attitude_inputs *inputs, const fs_pid_params *params,
                          fs_real dt_s, fs_pid_memory *memory_out, fs_vector3 *torque_out);

#endif
