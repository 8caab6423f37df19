/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Attitude reference: the filtered and differentiated attitude target that attitude controllers track.
 * flightstack/control/attitude_reference.py
 */
#include "fs_attitude_reference.h"

#include "fs_geometry.h"
#include "fs_math.h"

/* attitude_reference.py:52 */
static fs_vector3 clipped(const fs_vector3 *v, fs_real limit)
{
    const fs_real norm = fs_sqrt(v->x * v->x + v->y * v->y + v->z * v->z);
    if (norm <= limit) {
        return *v;
    }
    const fs_real scale = limit / norm;
    return (fs_vector3){v->x * scale, v->y * scale, v->z * scale};
}

/* Return the body rates after dt_s [rad/s], with the limits of acceleration and rate. attitude_reference.py:61 */
static fs_vector3 advanced_rates(const fs_reference_memory *memory, const fs_vector3 *error,
                                 const fs_reference_params *params, fs_real dt_s)
{
    const fs_real stiffness = params->bandwidth_rad_s * params->bandwidth_rad_s;
    const fs_real friction = FS_LIT(2.0) * params->damping * params->bandwidth_rad_s;
    const fs_vector3 v = {
        .x = stiffness * error->x - friction * memory->p_rad_s,
        .y = stiffness * error->y - friction * memory->q_rad_s,
        .z = stiffness * error->z - friction * memory->r_rad_s,
    };
    const fs_vector3 acceleration = clipped(&v, params->max_acceleration_rad_s2);
    const fs_vector3 v_2 = {
        .x = memory->p_rad_s + acceleration.x * dt_s,
        .y = memory->q_rad_s + acceleration.y * dt_s,
        .z = memory->r_rad_s + acceleration.z * dt_s,
    };
    return clipped(&v_2, params->max_rate_rad_s);
}

/* attitude_reference.py:84 */
void fs_attitude_reference_step(const fs_reference_memory *memory, const fs_quaternion *target,
                                const fs_reference_params *params, fs_real dt_s, fs_reference_memory *advanced_out,
                                fs_attitude_reference *attitude_reference_out)
{
    if (params->bandwidth_rad_s <= FS_LIT(0.0)) {
        const fs_vector3 zero = {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};
        const fs_reference_memory passed = {
            .w = target->w,
            .x = target->x,
            .y = target->y,
            .z = target->z,
            .p_rad_s = FS_LIT(0.0),
            .q_rad_s = FS_LIT(0.0),
            .r_rad_s = FS_LIT(0.0),
        };
        *advanced_out = passed;
        *attitude_reference_out = (fs_attitude_reference){*target, zero, zero};
        return;
    }
    fs_quaternion attitude = {memory->w, memory->x, memory->y, memory->z};
    const fs_quaternion conjugate = fs_conjugate(&attitude);
    const fs_quaternion quaternion_product = fs_quaternion_product(&conjugate, target);
    const fs_vector3 error = fs_rotation_vector(&quaternion_product);
    const fs_vector3 rates = advanced_rates(memory, &error, params, dt_s);
    /* after the limits */
    const fs_vector3 acceleration = {
        .x = (rates.x - memory->p_rad_s) / dt_s,
        .y = (rates.y - memory->q_rad_s) / dt_s,
        .z = (rates.z - memory->r_rad_s) / dt_s,
    };
    const fs_quaternion rotation_over = fs_rotation_over(&rates, dt_s);
    const fs_quaternion quaternion_product_2 = fs_quaternion_product(&attitude, &rotation_over);
    attitude = fs_normalised(&quaternion_product_2);
    const fs_reference_memory advanced = {
        .w = attitude.w,
        .x = attitude.x,
        .y = attitude.y,
        .z = attitude.z,
        .p_rad_s = rates.x,
        .q_rad_s = rates.y,
        .r_rad_s = rates.z,
    };
    *advanced_out = advanced;
    *attitude_reference_out = (fs_attitude_reference){attitude, rates, acceleration};
}

/* attitude_reference.py:111 */
fs_attitude_reference fs_in_body_frame(const fs_attitude_reference *reference, const fs_quaternion *attitude)
{
    const fs_quaternion conjugate = fs_conjugate(attitude);
    const fs_quaternion turn = fs_quaternion_product(&conjugate, &reference->attitude);
    return (fs_attitude_reference){
        .attitude = reference->attitude,
        .rates_frd_rad_s = fs_rotate(&turn, &reference->rates_frd_rad_s),
        .acceleration_frd_rad_s2 = fs_rotate(&turn, &reference->acceleration_frd_rad_s2),
    };
}
