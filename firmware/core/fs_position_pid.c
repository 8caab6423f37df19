/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Position and altitude control: the outer loop, from a position setpoint to attitude and thrust.
 * flightstack/control/position_pid.py
 */
#include "fs_position_pid.h"

#include "fs_math.h"
#include "fs_portable_math.h"

/* position_pid.py:60 */
static void horizontal_demand(const fs_position_memory *memory, const fs_vehicle_state *state,
                              const fs_position_setpoint *setpoint, const fs_position_params *params,
                              fs_real *north_out, fs_real *east_out)
{
    const fs_vector3 *p = &state->position_ned_m;
    const fs_vector3 *v = &state->velocity_ned_m_s;
    const fs_vector3 *p_d = &setpoint->position_ned_m;
    const fs_vector3 *v_d = &setpoint->velocity_ned_m_s;
    const fs_vector3 *a_d = &setpoint->acceleration_ned_m_s2;
    const fs_real north = a_d->x + params->kp_xy * (p_d->x - p->x) + params->kd_xy * (v_d->x - v->x) + memory->x;
    const fs_real east = a_d->y + params->kp_xy * (p_d->y - p->y) + params->kd_xy * (v_d->y - v->y) + memory->y;
    *north_out = north;
    *east_out = east;
}

/* Return the upward specific force [m/s^2]. position_pid.py:71 */
static fs_real lift_demand(const fs_position_memory *memory, const fs_vehicle_state *state,
                           const fs_position_setpoint *setpoint, const fs_position_params *params)
{
    const fs_real error_z = setpoint->position_ned_m.z - state->position_ned_m.z;
    const fs_real down = setpoint->acceleration_ned_m_s2.z + params->kp_z * error_z +
                         params->kd_z * (setpoint->velocity_ned_m_s.z - state->velocity_ned_m_s.z) + memory->z;
    return params->gravity_m_s2 - down;
}

/*
 * Return the attitude with this yaw whose thrust axis is along (forward, right, upward), upward positive.
 *
 * With theta = atan2(-forward, upward) and phi = atan2(right, level), level = sqrt(forward^2 + upward^2), the
 * tangents of the half angles are -forward / (level + upward) and right / (whole + level), without cancellation. One
 * common scale converts them to sines and cosines.
 *
 * position_pid.py:133
 */
static fs_quaternion attitude_along(fs_real forward, fs_real right, fs_real upward, fs_real half_yaw_sine,
                                    fs_real half_yaw_cosine)
{
    const fs_real level_square = forward * forward + upward * upward;
    const fs_real level = fs_sqrt(level_square);
    const fs_real whole = fs_sqrt(right * right + level_square);
    const fs_real along = level + upward;
    const fs_real across = whole + level;
    const fs_real scale = FS_LIT(0.5) / (fs_sqrt(level * along) * fs_sqrt(whole * across));
    const fs_real scaled_across = across * scale;
    const fs_real scaled_right = right * scale;
    /* of half roll, half pitch */
    const fs_real cos_cos = scaled_across * along;
    const fs_real cos_sin = -forward * scaled_across;
    const fs_real sin_cos_ = scaled_right * along;
    const fs_real sin_sin = -forward * scaled_right;
    return (fs_quaternion){
        .w = cos_cos * half_yaw_cosine + sin_sin * half_yaw_sine,
        .x = sin_cos_ * half_yaw_cosine - cos_sin * half_yaw_sine,
        .y = cos_sin * half_yaw_cosine + sin_cos_ * half_yaw_sine,
        .z = cos_cos * half_yaw_sine - sin_sin * half_yaw_cosine,
    };
}

/* position_pid.py:158 */
static fs_attitude_target target_for(fs_real north, fs_real east, fs_real lift, fs_real yaw_rad,
                                     const fs_vehicle_state *state, const fs_position_params *params)
{
    const fs_real upward = fs_max(lift, FS_LIT(0.5) * params->gravity_m_s2);
    fs_real half_sine;
    fs_real half_cosine;
    fs_sin_cos(FS_LIT(0.5) * yaw_rad, &half_sine, &half_cosine);
    const fs_real cos_yaw = half_cosine * half_cosine - half_sine * half_sine;
    const fs_real sin_yaw = FS_LIT(2.0) * half_sine * half_cosine;
    const fs_real forward = cos_yaw * north + sin_yaw * east;
    const fs_real right = cos_yaw * east - sin_yaw * north;
    const fs_quaternion *q = &state->attitude;
    const fs_real cos_tilt = FS_LIT(1.0) - FS_LIT(2.0) * (q->x * q->x + q->y * q->y);
    fs_real thrust = params->mass_kg * lift / fs_max(cos_tilt, FS_LIT(0.5));
    thrust = fs_min(fs_max(thrust, params->min_thrust_n), params->max_thrust_n);
    return (fs_attitude_target){
        .attitude = attitude_along(forward, right, upward, half_sine, half_cosine),
        .thrust_n = thrust,
    };
}

/* position_pid.py:86 */
static fs_real bounded(fs_real value, fs_real limit)
{
    return fs_min(fs_max(value, -limit), limit);
}

/* position_pid.py:91 */
void fs_position_pid_step(const fs_position_memory *memory, const fs_vehicle_state *state,
                          const fs_position_setpoint *setpoint, const fs_position_params *params, fs_real dt_s,
                          fs_real thrust_saturation, fs_position_memory *memory_out, fs_attitude_target *target_out)
{
    fs_real north;
    fs_real east;
    horizontal_demand(memory, state, setpoint, params, &north, &east);
    const fs_real error_z = setpoint->position_ned_m.z - state->position_ned_m.z;
    fs_real lift = lift_demand(memory, state, setpoint, params);
    const fs_real most = params->max_thrust_n / params->mass_kg;
    const fs_real least = params->min_thrust_n / params->mass_kg;
    /* the vertical integrator holds only in the direction of saturation, here or in the mixer */
    const bool at_top = lift >= most || thrust_saturation > FS_LIT(0.0);
    const bool at_bottom = lift <= least || thrust_saturation < FS_LIT(0.0);
    const bool vertical_free = !(at_top && error_z < FS_LIT(0.0)) && !(at_bottom && error_z > FS_LIT(0.0));
    lift = fs_min(fs_max(lift, least), most);
    const fs_real tilt_force = fs_tan(params->max_tilt_rad) * fs_max(lift, FS_LIT(0.5) * params->gravity_m_s2);
    const fs_real demand = fs_sqrt(north * north + east * east);
    const bool horizontal_free = demand <= tilt_force;
    if (!horizontal_free) {
        north = north * tilt_force / demand;
        east = east * tilt_force / demand;
    }
    const fs_attitude_target target = target_for(north, east, lift, setpoint->yaw_rad, state, params);
    const fs_real limit = params->max_integral_m_s2;
    const fs_real gain_xy = horizontal_free ? params->ki_xy * dt_s : FS_LIT(0.0);
    const fs_vector3 *error = &setpoint->position_ned_m;
    const fs_position_memory new_memory = {
        .x = bounded(memory->x + gain_xy * (error->x - state->position_ned_m.x), limit),
        .y = bounded(memory->y + gain_xy * (error->y - state->position_ned_m.y), limit),
        .z = bounded(memory->z + (vertical_free ? params->ki_z * dt_s * error_z : FS_LIT(0.0)), limit),
    };
    *memory_out = new_memory;
    *target_out = target;
}
