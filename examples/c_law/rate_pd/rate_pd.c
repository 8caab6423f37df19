#include "rate_pd.h"

void rate_pd_init(rate_pd_memory *memory)
{
    memory->rates_rad_s[0] = FS_LIT(0.0);
    memory->rates_rad_s[1] = FS_LIT(0.0);
    memory->rates_rad_s[2] = FS_LIT(0.0);
    memory->ticks = 0;
}

/* The filter starts at the first sample. */
static fs_real filtered(rate_pd_memory *memory, int axis, fs_real rate_rad_s, fs_real share)
{
    fs_real *kept = &memory->rates_rad_s[axis];

    *kept = memory->ticks == 0 ? rate_rad_s : *kept + share * (rate_rad_s - *kept);
    return *kept;
}

void rate_pd_step(rate_pd_memory *memory, const fs_attitude_inputs *inputs, const rate_pd_params *params, fs_real dt_s,
                  fs_vector3 *torque_out)
{
    const fs_real share = dt_s / (dt_s + params->filter_s);
    const fs_vector3 *rates = &inputs->rates_frd_rad_s, *wanted = &inputs->reference.rates_frd_rad_s;
    const fs_vector3 *ahead = &inputs->reference.acceleration_frd_rad_s2;
    const fs_real p = filtered(memory, 0, rates->x, share), q = filtered(memory, 1, rates->y, share);
    const fs_real r = filtered(memory, 2, rates->z, share);

    if (memory->ticks < INT32_MAX) {
        memory->ticks++;
    }
    torque_out->x = params->ix_kg_m2 * (params->angle_gain * inputs->error_rad.x +
                                        params->rate_gain * (wanted->x - p) + ahead->x);
    torque_out->y = params->iy_kg_m2 * (params->angle_gain * inputs->error_rad.y +
                                        params->rate_gain * (wanted->y - q) + ahead->y);
    torque_out->z = params->iz_kg_m2 * (FS_LIT(0.2) * params->angle_gain * inputs->error_rad.z +
                                        FS_LIT(0.4) * params->rate_gain * (wanted->z - r) + ahead->z);
}
