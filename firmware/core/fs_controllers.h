/* Generated from Python by flightstack.firmware.generator: do not edit. */
#ifndef FS_CONTROLLERS_H
#define FS_CONTROLLERS_H

#include "fs_mixer.h"
#include "fs_numbers.h"

/* Set the memories of the laws to their initial values. */
void fs_guidance_laws_reset(fs_guidance_law_memory *memory);

/* Run the guidance law of this index: the setpoint to track. Return 0 if the next memory is not finite. */
uint16_t fs_guidance_laws_step(uint16_t law, const fs_guidance_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_guidance_law_params *params,
                               fs_real dt_s, fs_guidance_law_memory *memory_out, fs_position_setpoint *setpoint_out);

/* Set the memories of the laws to their initial values. */
void fs_position_laws_reset(fs_position_law_memory *memory);

/* Run the position law of this index: the attitude target. Return 0 if the next memory is not finite. */
uint16_t fs_position_laws_step(uint16_t law, const fs_position_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_position_law_params *params,
                               fs_real dt_s, fs_real thrust_saturation, fs_position_law_memory *memory_out,
                               fs_attitude_target *target_out);

/* Set the memories of the laws to their initial values. */
void fs_controllers_reset(fs_controller_memory *memory);

/*
 * Run the attitude law of this index, one of FS_CONTROLLER_*: the torque [N m, FRD]. Return 0 if the next memory is
 * not finite.
 */
uint16_t fs_controllers_step(uint16_t law, const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                             const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                             fs_vector3 *torque_out);

/* Set the memories of the laws to their initial values. */
void fs_mixer_laws_reset(fs_mixer_law_memory *memory);

/*
 * Run the mixer of this index: rotor speeds [rad/s] and the achieved wrench. Return 0 if the next memory is not
 * finite.
 */
uint16_t fs_mixer_laws_step(uint16_t law, const fs_mixer_law_memory *memory, const fs_wrench *wrench,
                            const fs_mixer *mixer, const fs_mixer_law_params *params, fs_real dt_s,
                            fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_real work[3][FS_MAX_ROTORS],
                            fs_mixer_law_memory *memory_out, fs_wrench *achieved_out);

/* Set the largest tilt of the position laws that have one. */
void fs_position_laws_tilt(fs_position_law_params *params, fs_real max_tilt_rad);

#endif
