#include "fs_position_pid.h"

#include "fs_geometry.h"
#include "fs_math.h"

static fs_real bounded(fs_real value, fs_real limit)
{
    return fs_min(fs_max(value, -limit), limit);
}

/* Horizontal acceleration that is asked for, [m/s^2], NED; z is not used. */
static fs_vector3 horizontal_demand(const fs_position_memory *memory, const fs_vehicle_state *state,
                                    const fs_position_setpoint *setpoint, const fs_position_params *params)
{
    const fs_vector3 *p = &state->position_ned_m, *v = &state->velocity_ned_m_s;
    const fs_vector3 *p_d = &setpoint->position_ned_m, *v_d = &setpoint->velocity_ned_m_s;
    const fs_vector3 *a_d = &setpoint->acceleration_ned_m_s2;
    fs_vector3 demand = {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};

    demand.x = a_d->x + params->kp_xy * (p_d->x - p->x) + params->kd_xy * (v_d->x - v->x) + memory->x;
    demand.y = a_d->y + params->kp_xy * (p_d->y - p->y) + params->kd_xy * (v_d->y - v->y) + memory->y;
    return demand;
}

/*
 * Roll and pitch that turn the thrust along (forward, right, upward), then the yaw whose half has this sine and cosine.
 *
 * With pitch = atan2(-forward, upward) and roll = atan2(right, level), level = sqrt(forward^2 + upward^2), tangents of
 * the half angles are -forward / (level + upward) and right / (whole + level). upward is positive, so nothing cancels,
 * and one scale makes sines and cosines of them.
 */
static fs_quaternion attitude_along(fs_real forward, fs_real right, fs_real upward, fs_real half_yaw_sine, fs_real half_yaw_cosine)
{
    const fs_real level_square = forward * forward + upward * upward;
    const fs_real level = fs_sqrt(level_square), whole = fs_sqrt(right * right + level_square);
    const fs_real along = level + upward, across = whole + level;
    const fs_real scale = FS_LIT(0.5) / (fs_sqrt(level * along) * fs_sqrt(whole * across));
    const fs_real scaled_across = across * scale, scaled_right = right * scale;
    const fs_real cos_cos = scaled_across * along, cos_sin = -forward * scaled_across; /* of half roll, half pitch */
    const fs_real sin_cos = scaled_right * along, sin_sin = -forward * scaled_right;
    fs_quaternion q;

    q.w = cos_cos * half_yaw_cosine + sin_sin * half_yaw_sine;
    q.x = sin_cos * half_yaw_cosine - cos_sin * half_yaw_sine;
    q.y = cos_sin * half_yaw_cosine + sin_cos * half_yaw_sine;
    q.z = cos_cos * half_yaw_sine - sin_sin * half_yaw_cosine;
    return q;
}

/*
 * Attitude and thrust for an acceleration: roll and pitch turn the thrust there, it carries the weight at the
 * present tilt.
 */
static void target_for(const fs_vector3 *demand, fs_real lift_m_s2, fs_real yaw_rad, const fs_quaternion *q,
                       const fs_position_params *params, fs_attitude_target *target)
{
    /* below half the weight the direction of a falling vehicle's thrust would swing about: bound it */
    const fs_real upward = fs_max(lift_m_s2, FS_LIT(0.5) * params->gravity_m_s2);
    fs_real half_sine, half_cosine;
    fs_sin_cos(FS_LIT(0.5) * yaw_rad, &half_sine, &half_cosine);
    const fs_real cos_yaw = half_cosine * half_cosine - half_sine * half_sine;
    const fs_real sin_yaw = FS_LIT(2.0) * half_sine * half_cosine;
    const fs_real forward = cos_yaw * demand->x + sin_yaw * demand->y;
    const fs_real right = cos_yaw * demand->y - sin_yaw * demand->x;
    const fs_real cos_tilt = FS_LIT(1.0) - FS_LIT(2.0) * (q->x * q->x + q->y * q->y);
    const fs_real thrust_n = params->mass_kg * lift_m_s2 / fs_max(cos_tilt, FS_LIT(0.5));

    target->attitude = attitude_along(forward, right, upward, half_sine, half_cosine);
    target->thrust_n = fs_min(fs_max(thrust_n, params->min_thrust_n), params->max_thrust_n);
}

void fs_position_pid_step(fs_position_memory *memory, const fs_vehicle_state *state,
                          const fs_position_setpoint *setpoint, const fs_position_params *params, fs_real tan_max_tilt,
                          fs_real dt_s, fs_real thrust_saturation, fs_attitude_target *target)
{
    const fs_vector3 *wanted = &setpoint->position_ned_m, *is = &state->position_ned_m;
    const fs_real error_z = wanted->z - is->z;
    const fs_real most = params->max_thrust_n / params->mass_kg, least = params->min_thrust_n / params->mass_kg;
    const fs_real limit = params->max_integral_m_s2;
    fs_vector3 demand = horizontal_demand(memory, state, setpoint, params);
    fs_real lift, tilt_force, norm, gain_xy, step_z;
    uint16_t at_top, at_bottom;

    demand.z = setpoint->acceleration_ned_m_s2.z + params->kp_z * error_z +
               params->kd_z * (setpoint->velocity_ned_m_s.z - state->velocity_ned_m_s.z) + memory->z;
    lift = params->gravity_m_s2 - demand.z; /* specific force upwards */
    /* the vertical integrator stops only in the direction that cannot be followed, here or in the mixer */
    at_top = (lift >= most || thrust_saturation > FS_LIT(0.0)) ? 1U : 0U;
    at_bottom = (lift <= least || thrust_saturation < FS_LIT(0.0)) ? 1U : 0U;
    step_z = params->ki_z * dt_s * error_z;
    if ((at_top && error_z < FS_LIT(0.0)) || (at_bottom && error_z > FS_LIT(0.0))) {
        step_z = FS_LIT(0.0);
    }
    lift = fs_min(fs_max(lift, least), most);
    tilt_force = tan_max_tilt * fs_max(lift, FS_LIT(0.5) * params->gravity_m_s2);
    norm = fs_sqrt(demand.x * demand.x + demand.y * demand.y);
    gain_xy = params->ki_xy * dt_s;
    if (!(norm <= tilt_force)) {
        demand.x = demand.x * tilt_force / norm;
        demand.y = demand.y * tilt_force / norm;
        gain_xy = FS_LIT(0.0);
    }
    target_for(&demand, lift, setpoint->yaw_rad, &state->attitude, params, target);
    memory->x = bounded(memory->x + gain_xy * (wanted->x - is->x), limit);
    memory->y = bounded(memory->y + gain_xy * (wanted->y - is->y), limit);
    memory->z = bounded(memory->z + step_z, limit);
}
