/* Generated from Python by flightstack.firmware.generator: do not edit. */
#include "fs_controllers.h"

#include "fs_attitude_backstepping.h"
#include "fs_attitude_pid.h"
#include "fs_math.h"

void fs_controllers_reset(fs_controller_memory *memory)
{
    memory->pid.roll = FS_LIT(0.0);
    memory->pid.pitch = FS_LIT(0.0);
    memory->pid.yaw = FS_LIT(0.0);
    memory->backstepping.unused = FS_LIT(0.0);
}

static uint16_t run_pid(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                        const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                        fs_vector3 *torque_out)
{
    fs_attitude_pid_step(&memory->pid, inputs, &params->pid, dt_s, &memory_out->pid, torque_out);
    return (uint16_t)(fs_is_finite(memory_out->pid.roll) & fs_is_finite(memory_out->pid.pitch) &
                      fs_is_finite(memory_out->pid.yaw));
}

static uint16_t run_backstepping(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                                 const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                                 fs_vector3 *torque_out)
{
    fs_attitude_backstepping_step(&memory->backstepping, inputs, &params->backstepping, dt_s,
                                  &memory_out->backstepping, torque_out);
    return fs_is_finite(memory_out->backstepping.unused);
}

typedef uint16_t (*fs_law)(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                           const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                           fs_vector3 *torque_out);

static const fs_law laws[FS_CONTROLLERS] = {run_pid, run_backstepping};

uint16_t fs_controllers_step(uint16_t controller, const fs_controller_memory *memory,
                             const fs_attitude_inputs *inputs, const fs_controller_params *params, fs_real dt_s,
                             fs_controller_memory *memory_out, fs_vector3 *torque_out)
{
    *memory_out = *memory;
    return laws[controller](memory, inputs, params, dt_s, memory_out, torque_out);
}
