/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* PID attitude control, the paper's inner loop (section II.B.1). flightstack/control/attitude_pid.py */
#include "fs_attitude_pid.h"

#include "fs_math.h"

/* attitude_pid.py:58 */
fs_real fs_integrated(fs_real integral, fs_real error, fs_real saturation, fs_real dt_s)
{
    return error * saturation > FS_LIT(0.0) ? integral : integral + error * dt_s;
}

/* attitude_pid.py:64 */
void fs_attitude_pid_step(const fs_pid_memory *memory, const fs_attitude_inputs *inputs, const fs_pid_params *params,
                          fs_real dt_s, fs_pid_memory *memory_out, fs_vector3 *torque_out)
{
    const fs_vector3 *error = &inputs->error_rad;
    const fs_vector3 *rates = &inputs->rates_frd_rad_s;
    const fs_attitude_reference *reference = &inputs->reference;
    const fs_vector3 *rates_d = &reference->rates_frd_rad_s;
    const fs_vector3 *acceleration_d = &reference->acceleration_frd_rad_s2;
    const fs_pid_memory new_memory = {
        .roll = fs_integrated(memory->roll, error->x, inputs->saturation.x, dt_s),
        .pitch = fs_integrated(memory->pitch, error->y, inputs->saturation.y, dt_s),
        .yaw = fs_integrated(memory->yaw, error->z, inputs->saturation.z, dt_s),
    };
    const fs_real ff = params->rate_feedforward;
    const fs_real fa = params->acceleration_feedforward;
    const fs_real roll = params->kp_roll * error->x + params->ki_roll * new_memory.roll +
                         params->kd_roll * (ff * rates_d->x - rates->x);
    const fs_real pitch = params->kp_pitch * error->y + params->ki_pitch * new_memory.pitch +
                          params->kd_pitch * (ff * rates_d->y - rates->y);
    const fs_real yaw = params->kp_yaw * error->z + params->ki_yaw * new_memory.yaw +
                        params->kd_yaw * (ff * rates_d->z - rates->z);
    const fs_vector3 torque = {
        .x = params->ix_kg_m2 * (roll + fa * acceleration_d->x),
        .y = params->iy_kg_m2 * (pitch + fa * acceleration_d->y),
        .z = params->iz_kg_m2 * (yaw + fa * acceleration_d->z),
    };
    *memory_out = new_memory;
    *torque_out = torque;
}
