#include "fs_attitude_backstepping.h"

/*
 * Angular acceleration demanded on one axis before the cancelling terms [rad/s^2]: e1 = x_d - x, e2 = x' - x_d' -
 * c1 e1.
 */
static fs_real axis(fs_real error, fs_real rate, fs_real rate_d, fs_real acceleration_d, fs_real c_outer,
                    fs_real c_inner)
{
    const fs_real e1 = error;
    const fs_real e2 = rate - rate_d - c_outer * e1;

    return e1 - c_inner * e2 - c_outer * (c_outer * e1 + e2) + acceleration_d;
}

fs_vector3 fs_attitude_backstepping_step(const fs_vector3 *error_rad, const fs_vector3 *rates_frd_rad_s,
                                         const fs_attitude_reference *reference, fs_real relative_rotor_speed_rad_s,
                                         const fs_backstepping_params *params)
{
    const fs_vector3 *error = error_rad, *rates = rates_frd_rad_s;
    const fs_vector3 *ahead = &reference->rates_frd_rad_s;
    const fs_vector3 *push = &reference->acceleration_frd_rad_s2;
    const fs_real ff = params->rate_feedforward, fa = params->acceleration_feedforward;
    const fs_real roll = axis(error->x, rates->x, ff * ahead->x, fa * push->x, params->c1, params->c2);
    const fs_real pitch = axis(error->y, rates->y, ff * ahead->y, fa * push->y, params->c3, params->c4);
    const fs_real yaw = axis(error->z, rates->z, ff * ahead->z, fa * push->z, params->c5, params->c6);
    const fs_real ix = params->ix_kg_m2, iy = params->iy_kg_m2, iz = params->iz_kg_m2;
    const fs_real p = rates->x, q = rates->y, r = rates->z;
    const fs_real momentum = params->rotor_inertia_kg_m2 * relative_rotor_speed_rad_s; /* J_r Omega_r */
    fs_vector3 torque;

    torque.x = ix * roll - (iy - iz) * q * r - momentum * q;
    torque.y = iy * pitch - (iz - ix) * p * r + momentum * p;
    torque.z = iz * yaw - (ix - iy) * p * q;
    return torque;
}
