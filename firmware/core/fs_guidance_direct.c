/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* The built-in guidance law: the setpoint of mission and modes, unchanged. flightstack/control/guidance_direct.py */
#include "fs_guidance_direct.h"

#include "fs_math.h"

/* guidance_direct.py:14 */
void fs_direct_step(const fs_no_memory *memory, const fs_vehicle_state *state, const fs_position_setpoint *setpoint,
                    const fs_no_params *params, fs_real dt_s, fs_no_memory *memory_out,
                    fs_position_setpoint *setpoint_out)
{
    (void)state;
    (void)params;
    (void)dt_s;
    *memory_out = *memory;
    *setpoint_out = *setpoint;
}
