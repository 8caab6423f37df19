#include "fs_attitude_reference.h"

#include "fs_geometry.h"
#include "fs_math.h"

static fs_vector3 clipped(const fs_vector3 *v, fs_real limit)
{
    const fs_real norm = fs_sqrt(v->x * v->x + v->y * v->y + v->z * v->z);
    fs_vector3 result = *v;

    if (!(norm <= limit)) {
        const fs_real scale = limit / norm;
        result.x = v->x * scale;
        result.y = v->y * scale;
        result.z = v->z * scale;
    }
    return result;
}

static void keep(fs_reference_memory *memory, const fs_attitude_reference *reference)
{
    memory->w = reference->attitude.w;
    memory->x = reference->attitude.x;
    memory->y = reference->attitude.y;
    memory->z = reference->attitude.z;
    memory->p_rad_s = reference->rates_frd_rad_s.x;
    memory->q_rad_s = reference->rates_frd_rad_s.y;
    memory->r_rad_s = reference->rates_frd_rad_s.z;
}

/* Acceleration towards the target: a damped oscillator on the rotation group, its error the quaternion's logarithm. */
static fs_vector3 pull(const fs_reference_memory *memory, const fs_quaternion *attitude, const fs_quaternion *target,
                       const fs_reference_params *params)
{
    const fs_quaternion inverse = fs_conjugate(attitude);
    const fs_quaternion turn = fs_quaternion_product(&inverse, target);
    const fs_vector3 error = fs_rotation_vector(&turn);
    const fs_real stiffness = params->bandwidth_rad_s * params->bandwidth_rad_s;
    const fs_real friction = FS_LIT(2.0) * params->damping * params->bandwidth_rad_s;
    fs_vector3 acceleration;

    acceleration.x = stiffness * error.x - friction * memory->p_rad_s;
    acceleration.y = stiffness * error.y - friction * memory->q_rad_s;
    acceleration.z = stiffness * error.z - friction * memory->r_rad_s;
    return clipped(&acceleration, params->max_acceleration_rad_s2);
}

void fs_attitude_reference_step(const fs_reference_memory *memory, const fs_quaternion *target,
                                const fs_reference_params *params, fs_real dt_s, fs_reference_memory *next,
                                fs_attitude_reference *reference)
{
    const fs_vector3 zero = {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};
    const fs_quaternion attitude = {memory->w, memory->x, memory->y, memory->z};
    fs_vector3 acceleration, rates;
    fs_quaternion turned;

    if (params->bandwidth_rad_s <= FS_LIT(0.0)) {
        reference->attitude = *target;
        reference->rates_frd_rad_s = zero;
        reference->acceleration_frd_rad_s2 = zero;
        keep(next, reference);
        return;
    }
    acceleration = pull(memory, &attitude, target, params);
    rates.x = memory->p_rad_s + acceleration.x * dt_s;
    rates.y = memory->q_rad_s + acceleration.y * dt_s;
    rates.z = memory->r_rad_s + acceleration.z * dt_s;
    rates = clipped(&rates, params->max_rate_rad_s);
    acceleration.x = (rates.x - memory->p_rad_s) / dt_s; /* what the limits left of it */
    acceleration.y = (rates.y - memory->q_rad_s) / dt_s;
    acceleration.z = (rates.z - memory->r_rad_s) / dt_s;
    turned = fs_rotation_over(&rates, dt_s);
    turned = fs_quaternion_product(&attitude, &turned);
    reference->attitude = fs_normalised(&turned);
    reference->rates_frd_rad_s = rates;
    reference->acceleration_frd_rad_s2 = acceleration;
    keep(next, reference);
}

fs_quaternion fs_in_body_frame(fs_attitude_reference *reference, const fs_quaternion *attitude)
{
    const fs_quaternion inverse = fs_conjugate(attitude);
    const fs_quaternion turn = fs_quaternion_product(&inverse, &reference->attitude);

    reference->rates_frd_rad_s = fs_rotate(&turn, &reference->rates_frd_rad_s);
    reference->acceleration_frd_rad_s2 = fs_rotate(&turn, &reference->acceleration_frd_rad_s2);
    return turn;
}
