/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Position and altitude control: the outer loop, from a position setpoint to attitude and thrust.
 * flightstack/control/position_pid.py
 */
#ifndef FS_POSITION_PID_H
#define FS_POSITION_PID_H

#include "fs_numbers.h"
#include "fs_types.h"

/*
 * Return the attitude and the thrust that track the setpoint.
 *
 * PID on position in NED with feed-forward; the desired specific force f = a - g is converted to roll and pitch by
 * inverting eq. 7 (NED signs corrected): theta = atan2(-f_x', -f_z), phi = atan2(f_y', sqrt(f_x'^2 + f_z^2)), f' in
 * the frame rotated by the yaw setpoint. Thrust is compensated for the present tilt. Integrators hold while tilt or
 * thrust is at its limit, or while the mixer is saturated in thrust (thrust_saturation: the last tick achieved more
 * (-1) or less (+1) than demanded).
 *
 * position_pid.py:91
 */
void fs_position_pid_step(const fs_position_memory *memory, const fs_vehicle_state *state,
                          const fs_position_setpoint *setpoint, const fs_position_params *params, fs_real dt_s,
                          fs_real thrust_saturation, fs_position_memory *memory_out, fs_attitude_target *target_out);

#endif
