/*
 * fs_controllers.c, which keeps what laws of one's own may use and the built-in ones do not: the period that each law
 * was given last, the memories of guidance and mixer, which count their steps, and the attitude for the attitude law.
 */
#define fs_guidance_laws_step real_guidance_laws_step
#define fs_position_laws_step real_position_laws_step
#define fs_controllers_step real_attitude_laws_step
#define fs_mixer_laws_step real_mixer_laws_step
#include "fs_controllers.c"
#undef fs_guidance_laws_step
#undef fs_position_laws_step
#undef fs_controllers_step
#undef fs_mixer_laws_step

static fs_real told[10];

void laws_told(fs_real out[10]);
void laws_told(fs_real out[10])
{
    for (uint16_t i = 0U; i < 10U; i++) {
        out[i] = told[i];
    }
}

uint16_t fs_guidance_laws_step(uint16_t law, const fs_guidance_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_guidance_law_params *params, fs_real dt_s,
                               fs_guidance_law_memory *memory_out, fs_position_setpoint *setpoint_out)
{
    told[0] = dt_s;
    (void)real_guidance_laws_step(law, memory, state, setpoint, params, dt_s, memory_out, setpoint_out);
    memory_out->direct.unused = memory->direct.unused + FS_LIT(1.0);
    told[4] = memory_out->direct.unused;
    return 1U;
}

uint16_t fs_position_laws_step(uint16_t law, const fs_position_law_memory *memory, const fs_vehicle_state *state,
                               const fs_position_setpoint *setpoint, const fs_position_law_params *params, fs_real dt_s,
                               fs_real thrust_saturation, fs_position_law_memory *memory_out,
                               fs_attitude_target *target_out)
{
    told[1] = dt_s;
    return real_position_laws_step(law, memory, state, setpoint, params, dt_s, thrust_saturation, memory_out, target_out);
}

uint16_t fs_controllers_step(uint16_t law, const fs_controller_memory *memory, const fs_attitude_inputs *inputs,
                             const fs_controller_params *params, fs_real dt_s, fs_controller_memory *memory_out,
                             fs_vector3 *torque_out)
{
    told[2] = dt_s;
    told[6] = inputs->attitude.w;
    told[7] = inputs->attitude.x;
    told[8] = inputs->attitude.y;
    told[9] = inputs->attitude.z;
    return real_attitude_laws_step(law, memory, inputs, params, dt_s, memory_out, torque_out);
}

uint16_t fs_mixer_laws_step(uint16_t law, const fs_mixer_law_memory *memory, const fs_wrench *wrench,
                            const fs_mixer *mixer, const fs_mixer_law_params *params, fs_real dt_s,
                            fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_real work[3][FS_MAX_ROTORS],
                            fs_mixer_law_memory *memory_out, fs_wrench *achieved_out)
{
    told[3] = dt_s;
    (void)real_mixer_laws_step(law, memory, wrench, mixer, params, dt_s, rotor_speed_rad_s, work, memory_out, achieved_out);
    memory_out->allocation.unused = memory->allocation.unused + FS_LIT(1.0);
    told[5] = memory_out->allocation.unused;
    return 1U;
}
