/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Backstepping attitude control, the paper's nonlinear inner loop (section II.B.2, corrected).
 * flightstack/control/attitude_backstepping.py
 */
#ifndef FS_ATTITUDE_BACKSTEPPING_H
#define FS_ATTITUDE_BACKSTEPPING_H

#include "fs_numbers.h"
#include "fs_types.h"

/*
 * Return the torque [N m, FRD]: the law of each axis, with inertial coupling and gyroscopic torque cancelled.
 * attitude_backstepping.py:64
 */
void fs_attitude_backstepping_step(const fs_backstepping_memory *memory, const fs_attitude_inputs *inputs,
                                   const fs_backstepping_params *params, fs_real dt_s,
                                   fs_backstepping_memory *memory_out, fs_vector3 *torque_out);

#endif
