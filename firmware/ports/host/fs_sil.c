#include "fs_sil.h"

#include "fs_params.h"

/* In fs_real; beyond its range infinite, where C leaves the conversion undefined. */
static fs_real rounded(double value)
{
    if (value > (double)FS_REAL_MAX) {
        return FS_REAL_MAX * FS_LIT(2.0);
    }
    if (value < -(double)FS_REAL_MAX) {
        return -FS_REAL_MAX * FS_LIT(2.0);
    }
    return (fs_real)value;
}

static fs_vector3 take_vector(const double *at)
{
    const fs_vector3 vector = {rounded(at[0]), rounded(at[1]), rounded(at[2])};

    return vector;
}

static fs_quaternion take_quaternion(const double *at)
{
    const fs_quaternion quaternion = {rounded(at[0]), rounded(at[1]), rounded(at[2]), rounded(at[3])};

    return quaternion;
}

static void give_vector(double *at, const fs_vector3 *vector)
{
    at[0] = (double)vector->x;
    at[1] = (double)vector->y;
    at[2] = (double)vector->z;
}

static void give_quaternion(double *at, const fs_quaternion *quaternion)
{
    at[0] = (double)quaternion->w;
    at[1] = (double)quaternion->x;
    at[2] = (double)quaternion->y;
    at[3] = (double)quaternion->z;
}

static void give_wrench(double *at, const fs_wrench *wrench)
{
    at[0] = (double)wrench->thrust_n;
    give_vector(&at[1], &wrench->torque_frd_n_m);
}

uint32_t fs_sil_size(void)
{
    return (uint32_t)sizeof(fs_loops);
}

uint32_t fs_sil_real_size(void)
{
    return (uint32_t)sizeof(fs_real);
}

void fs_sil_init(fs_loops *loops)
{
    fs_loops_init(loops);
}

void fs_sil_step(fs_loops *loops, const double *input, uint32_t flags, double *output)
{
    fs_loop_input in;
    fs_loop_output out;
    fs_loop_cost cost;
    uint16_t i;

    in.state.position_ned_m = take_vector(&input[0]);
    in.state.velocity_ned_m_s = take_vector(&input[3]);
    in.state.attitude = take_quaternion(&input[6]);
    in.state.rates_frd_rad_s = take_vector(&input[10]);
    in.setpoint.position_ned_m = take_vector(&input[13]);
    in.setpoint.velocity_ned_m_s = take_vector(&input[16]);
    in.setpoint.acceleration_ned_m_s2 = take_vector(&input[19]);
    in.setpoint.yaw_rad = rounded(input[22]);
    in.setpoint.yaw_rate_rad_s = rounded(input[23]);
    in.target.attitude = take_quaternion(&input[24]);
    in.target.thrust_n = rounded(input[28]);
    in.flags = (uint16_t)flags;
    fs_loops_step(loops, &in, NULL, &out, &cost);
    give_quaternion(&output[0], &out.attitude_target.attitude);
    output[4] = (double)out.attitude_target.thrust_n;
    give_quaternion(&output[5], &out.reference.attitude);
    give_vector(&output[9], &out.reference.rates_frd_rad_s);
    give_vector(&output[12], &out.reference.acceleration_frd_rad_s2);
    give_wrench(&output[15], &out.wrench);
    give_wrench(&output[19], &out.wrench_achieved);
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        output[23U + i] = (double)out.rotor_command_rad_s[i];
    }
    output[31] = (double)out.status;
}

uint32_t fs_sil_set(fs_loops *loops, const char *name, double value)
{
    const int16_t index = fs_param_find(name);

    if (index < 0) {
        return FS_SIL_UNKNOWN;
    }
    return (fs_param_set(loops, (uint16_t)index, rounded(value)) == FS_PARAM_DONE) ? FS_SIL_DONE : FS_SIL_REFUSED;
}

double fs_sil_get(const fs_loops *loops, const char *name)
{
    const int16_t index = fs_param_find(name);

    return (index < 0) ? 0.0 : (double)fs_param_get(loops, (uint16_t)index);
}
