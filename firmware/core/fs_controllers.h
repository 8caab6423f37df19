/* Generated from Python by flightstack.firmware.generator: do not edit. */
#ifndef FS_CONTROLLERS_H
#define FS_CONTROLLERS_H

#include "fs_numbers.h"

/* Set the memories of all attitude laws to their initial values. */
void fs_controllers_reset(fs_controller_memory *memory);

/*
 * Run the attitude law of this index, one of FS_CONTROLLER_*: torque [N m, FRD] and the next memory.
 * Return 0 if the next memory is not finite.
 */
uint16_t fs_controllers_step(uint16_t controller, const fs_controller_memory *memory,
                             const fs_attitude_inputs *inputs, const fs_controller_params *params, fs_real dt_s,
                             fs_controller_memory *memory_out, fs_vector3 *torque_out);

#endif
