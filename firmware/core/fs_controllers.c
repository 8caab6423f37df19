/* Generated from Python by flightstack.firmware.generator: do not edit. */
#include "fs_controllers.h"

#include "fs_attitude_backstepping.h"
#include "fs_attitude_pid.h"
#include "fs_guidance_direct.h"
#include "fs_math.h"
#include "fs_position_pid.h"

void fs_guidance_laws_reset(fs_guidance_law_memory *memory)
{
    memory->direct.unused = FS_LIT(0.0);
}

static uint16_t run_guidance_direct(const fs_guidance_law_memory *memory, const fs_vehicle_state *state,
                                    const fs_position_setpoint *setpoint, const fs_guidance_law_params *params,
                                    fs_real dt_s, fs_guidance_law_memory *memory_out,
                                    fs_position_setpoint *setpoint_out)
{
    fs_direct_step(&memory->direct, state, setpoint, &params->direct, dt_s, &memory_out->direct, setpoint_out);
    return fs_is_finite(memory_out->direct.unused);
}

typedef uint16_t (*guidance_step)(const fs_guidance_law_memory *memory, const fs_vehicle_state *state,
                                  const fs_position_setpoint *setpoint, const fs_guidance_law_params *params,
                                  fs_real dt_s, fs_guidance_law_memory *memory_out,
                                  fs_position_setpoint *setpoint_out);

static const guidance_step guidance_laws[] = {run_guidance_direct};

uint16_t fs_guidance_laws_step(uint16_t law, const fs_guidance_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_guidance_law_params *params,
                               fs_real dt_s, fs_guidance_law_memory *memory_out, fs_position_setpoint *setpoint_out)
{
    *memory_out = *memory;
    return guidance_laws[law](memory, state, setpoint, params, dt_s, memory_out, setpoint_out);
}

void fs_position_laws_reset(fs_position_law_memory *memory)
{
    memory->pid.x = FS_LIT(0.0);
    memory->pid.y = FS_LIT(0.0);
    memory->pid.z = FS_LIT(0.0);
}

static uint16_t run_position_pid(const fs_position_law_memory *memory, const fs_vehicle_state *state,
                                 const fs_position_setpoint *setpoint, const fs_position_law_params *params,
                                 fs_real dt_s, fs_real thrust_saturation, fs_position_law_memory *memory_out,
                                 fs_attitude_target *target_out)
{
    fs_position_pid_step(&memory->pid, state, setpoint, &params->pid, dt_s, thrust_saturation, &memory_out->pid,
                         target_out);
    return (uint16_t)(fs_is_finite(memory_out->pid.x) & fs_is_finite(memory_out->pid.y) &
                      fs_is_finite(memory_out->pid.z));
}

typedef uint16_t (*position_step)(const fs_position_law_memory *memory, const fs_vehicle_state *state,
                                  const fs_position_setpoint *setpoint, const fs_position_law_params *params,
                                  fs_real dt_s, fs_real thrust_saturation, fs_position_law_memory *memory_out,
                                  fs_attitude_target *target_out);

static const position_step position_laws[] = {run_position_pid};

uint16_t fs_position_laws_step(uint16_t law, const fs_position_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_position_law_params *params,
                               fs_real dt_s, fs_real thrust_saturation, fs_position_law_memory *memory_out,
                               fs_attitude_target *target_out)
{
    *memory_out = *memory;
    return position_laws[law](memory, state, setpoint, params, dt_s, thrust_saturation, memory_out, target_out);
}

void fs_controllers_reset(fs_controller_memory *memory)
{
    memory->pid.roll = FS_LIT(0.0);
    memory->pid.pitch = FS_LIT(0.0);
    memory->pid.yaw = FS_LIT(0.0);
    memory->backstepping.unused = FS_LIT(0.0);
}

static uint16_t run_attitude_pid(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                                 const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                                 fs_vector3 *torque_out)
{
    fs_attitude_pid_step(&memory->pid, inputs, &params->pid, dt_s, &memory_out->pid, torque_out);
    return (uint16_t)(fs_is_finite(memory_out->pid.roll) & fs_is_finite(memory_out->pid.pitch) &
                      fs_is_finite(memory_out->pid.yaw));
}

static uint16_t run_attitude_backstepping(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                                          const fs_controller_params *params, fs_real dt_s,
                                          fs_controller_memory *memory_out, fs_vector3 *torque_out)
{
    fs_attitude_backstepping_step(&memory->backstepping, inputs, &params->backstepping, dt_s,
                                  &memory_out->backstepping, torque_out);
    return fs_is_finite(memory_out->backstepping.unused);
}

typedef uint16_t (*attitude_step)(const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                                  const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                                  fs_vector3 *torque_out);

static const attitude_step attitude_laws[] = {run_attitude_pid, run_attitude_backstepping};

uint16_t fs_controllers_step(uint16_t law, const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                             const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                             fs_vector3 *torque_out)
{
    *memory_out = *memory;
    return attitude_laws[law](memory, inputs, params, dt_s, memory_out, torque_out);
}

void fs_mixer_laws_reset(fs_mixer_law_memory *memory)
{
    memory->allocation.unused = FS_LIT(0.0);
}

static uint16_t run_mixer_allocation(const fs_mixer_law_memory *memory, const fs_wrench *wrench,
                                     const fs_mixer *mixer, const fs_mixer_law_params *params, fs_real dt_s,
                                     fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_real work[3][FS_MAX_ROTORS],
                                     fs_mixer_law_memory *memory_out, fs_wrench *achieved_out)
{
    fs_allocation_step(&memory->allocation, wrench, mixer, &params->allocation, dt_s, rotor_speed_rad_s, work,
                       &memory_out->allocation, achieved_out);
    return fs_is_finite(memory_out->allocation.unused);
}

typedef uint16_t (*mixer_step)(const fs_mixer_law_memory *memory, const fs_wrench *wrench, const fs_mixer *mixer,
                               const fs_mixer_law_params *params, fs_real dt_s,
                               fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_real work[3][FS_MAX_ROTORS],
                               fs_mixer_law_memory *memory_out, fs_wrench *achieved_out);

static const mixer_step mixer_laws[] = {run_mixer_allocation};

uint16_t fs_mixer_laws_step(uint16_t law, const fs_mixer_law_memory *memory, const fs_wrench *wrench,
                            const fs_mixer *mixer, const fs_mixer_law_params *params, fs_real dt_s,
                            fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_real work[3][FS_MAX_ROTORS],
                            fs_mixer_law_memory *memory_out, fs_wrench *achieved_out)
{
    *memory_out = *memory;
    return mixer_laws[law](memory, wrench, mixer, params, dt_s, rotor_speed_rad_s, work, memory_out, achieved_out);
}

void fs_position_laws_tilt(fs_position_law_params *params, fs_real max_tilt_rad)
{
    params->pid.max_tilt_rad = max_tilt_rad;
}
