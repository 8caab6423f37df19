#include "fs_attitude_pid.h"

/* Integrate unless the actuators cannot follow in the error's direction. */
static fs_real integrated(fs_real integral, fs_real error, fs_real saturation, fs_real dt_s)
{
    return error * saturation > FS_LIT(0.0) ? integral : integral + error * dt_s;
}

fs_vector3 fs_attitude_pid_step(fs_pid_memory *memory, const fs_vector3 *error_rad, const fs_vector3 *rates_frd_rad_s,
                                const fs_attitude_reference *reference, const fs_vector3 *saturation,
                                const fs_pid_params *params, fs_real dt_s)
{
    const fs_vector3 *error = error_rad, *rates = rates_frd_rad_s;
    const fs_vector3 *ahead = &reference->rates_frd_rad_s;
    const fs_vector3 *push = &reference->acceleration_frd_rad_s2;
    const fs_real ff = params->rate_feedforward, fa = params->acceleration_feedforward;
    fs_real roll, pitch, yaw;
    fs_vector3 torque;

    memory->roll = integrated(memory->roll, error->x, saturation->x, dt_s);
    memory->pitch = integrated(memory->pitch, error->y, saturation->y, dt_s);
    memory->yaw = integrated(memory->yaw, error->z, saturation->z, dt_s);
    roll = params->kp_roll * error->x + params->ki_roll * memory->roll + params->kd_roll * (ff * ahead->x - rates->x);
    pitch = params->kp_pitch * error->y + params->ki_pitch * memory->pitch +
            params->kd_pitch * (ff * ahead->y - rates->y);
    yaw = params->kp_yaw * error->z + params->ki_yaw * memory->yaw + params->kd_yaw * (ff * ahead->z - rates->z);
    torque.x = params->ix_kg_m2 * (roll + fa * push->x);
    torque.y = params->iy_kg_m2 * (pitch + fa * push->y);
    torque.z = params->iz_kg_m2 * (yaw + fa * push->z);
    return torque;
}
