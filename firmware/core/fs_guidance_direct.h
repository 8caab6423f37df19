/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* The built-in guidance law: the setpoint of mission and modes, unchanged. flightstack/control/guidance_direct.py */
#ifndef FS_GUIDANCE_DIRECT_H
#define FS_GUIDANCE_DIRECT_H

#include "fs_numbers.h"
#include "fs_types.h"

/* Return the setpoint, which the trajectory of mission and modes has made feasible. guidance_direct.py:14 */
void fs_direct_step(const fs_no_memory *memory, const fs_vehicle_state *state, const fs_position_setpoint *setpoint,
                    const fs_no_params *params, fs_real dt_s, fs_no_memory *memory_out,
                    fs_position_setpoint *setpoint_out);

#endif
