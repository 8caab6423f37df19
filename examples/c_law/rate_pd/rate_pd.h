/* PD attitude control with filtered body rates. */
#ifndef RATE_PD_H
#define RATE_PD_H

#include "rate_pd_params.h"

typedef struct {
    fs_real rates_rad_s[3];
    int32_t ticks;
} rate_pd_memory;

void rate_pd_init(rate_pd_memory *memory);

void rate_pd_step(rate_pd_memory *memory, const fs_attitude_inputs *inputs, const rate_pd_params *params, fs_real dt_s,
                  fs_vector3 *torque_out);

#endif
