/* Position and altitude control, the outer loop: flightstack/control/position_pid.py. */
#ifndef FS_POSITION_PID_H
#define FS_POSITION_PID_H

#include "fs_numbers.h"

/*
 * Write the attitude and the thrust that accelerate the vehicle along the setpoint, and advance the integrals.
 *
 * tan_max_tilt: tangent of params->max_tilt_rad, which changes too seldom to be computed in every tick.
 * thrust_saturation: what the mixer could not follow in the last tick, negative if it made more than demanded.
 */
void fs_position_pid_step(fs_position_memory *memory, const fs_vehicle_state *state,
                          const fs_position_setpoint *setpoint, const fs_position_params *params, fs_real tan_max_tilt,
                          fs_real dt_s, fs_real thrust_saturation, fs_attitude_target *target);

#endif
