/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Backstepping attitude control, the paper's nonlinear inner loop (section II.B.2, corrected).
 * flightstack/control/attitude_backstepping.py
 */
#include "fs_attitude_backstepping.h"

#include "fs_math.h"

/*
 * Return the angular acceleration [rad/s^2] of one axis, without the terms that cancel coupling.
 *
 * epsilon1 = x_d - x, epsilon2 = x' - x_d' - c1 epsilon1, and epsilon1 - c2 epsilon2 - c1 (c1 epsilon1 + epsilon2) +
 * x_d''.
 *
 * attitude_backstepping.py:51
 */
static fs_real axis(fs_real error, fs_real rate, fs_real rate_d, fs_real acceleration_d, fs_real c_outer,
                    fs_real c_inner)
{
    const fs_real e1 = error;
    const fs_real e2 = rate - rate_d - c_outer * e1;
    return e1 - c_inner * e2 - c_outer * (c_outer * e1 + e2) + acceleration_d;
}

/* attitude_backstepping.py:64 */
void fs_attitude_backstepping_step(const fs_backstepping_memory *memory, const fs_attitude_inputs *inputs,
                                   const fs_backstepping_params *params, fs_real dt_s,
                                   fs_backstepping_memory *memory_out, fs_vector3 *torque_out)
{
    (void)dt_s;
    const fs_vector3 *error = &inputs->error_rad;
    const fs_vector3 *rates = &inputs->rates_frd_rad_s;
    const fs_attitude_reference *reference = &inputs->reference;
    const fs_real ff = params->rate_feedforward;
    const fs_real fa = params->acceleration_feedforward;
    const fs_vector3 *rates_d = &reference->rates_frd_rad_s;
    const fs_vector3 *acceleration_d = &reference->acceleration_frd_rad_s2;
    const fs_real roll = axis(error->x, rates->x, ff * rates_d->x, fa * acceleration_d->x, params->c1, params->c2);
    const fs_real pitch = axis(error->y, rates->y, ff * rates_d->y, fa * acceleration_d->y, params->c3, params->c4);
    const fs_real yaw = axis(error->z, rates->z, ff * rates_d->z, fa * acceleration_d->z, params->c5, params->c6);
    const fs_real ix = params->ix_kg_m2;
    const fs_real iy = params->iy_kg_m2;
    const fs_real iz = params->iz_kg_m2;
    const fs_real p = rates->x;
    const fs_real q = rates->y;
    const fs_real r = rates->z;
    const fs_real momentum = params->rotor_inertia_kg_m2 * inputs->relative_rotor_speed_rad_s; /* J_r Omega_r */
    const fs_vector3 torque = {
        .x = ix * roll - (iy - iz) * q * r - momentum * q,
        .y = iy * pitch - (iz - ix) * p * r + momentum * p,
        .z = iz * yaw - (ix - iy) * p * q,
    };
    *memory_out = *memory;
    *torque_out = torque;
}
