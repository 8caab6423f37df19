/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * States of the filter: the nominal state, and the layout of its error state. flightstack/estimation/error_state.py
 */
#include "fs_error_state.h"

#include "fs_estimation_geometry.h"
#include "fs_estimation_math.h"
#include "fs_geometry.h"
#include "fs_math.h"

#define FS_ATTITUDE 0

/* error_state.py:58 */
fs_vector3 fs_read_vector(const fs_real x[], int32_t at)
{
    return (fs_vector3){x[at], x[at + 1], x[at + 2]};
}

/* error_state.py:76 */
fs_vector3 fs_scaled(const fs_vector3 *a, fs_real factor)
{
    return (fs_vector3){a->x * factor, a->y * factor, a->z * factor};
}

/* error_state.py:82 */
fs_nominal fs_read_nominal(const fs_real x[])
{
    return (fs_nominal){
        .attitude = {x[0], x[1], x[2], x[3]},
        .velocity_ned_m_s = fs_read_vector(x, 4),
        .position_ned_m = fs_read_vector(x, 7),
        .gyro_bias_rad_s = fs_read_vector(x, 10),
        .accel_bias_m_s2 = fs_read_vector(x, 13),
        .earth_field_ned_gauss = fs_read_vector(x, 16),
        .body_field_frd_gauss = fs_read_vector(x, 19),
        .wind_north_m_s = x[22],
        .wind_east_m_s = x[23],
        .baro_bias_m = x[24],
        .gnss_bias_ned_m = fs_read_vector(x, 25),
    };
}

/* error_state.py:114 */
fs_quaternion fs_turned(const fs_quaternion *q, const fs_vector3 *world_rotation)
{
    const fs_quaternion rotation_over = fs_rotation_over(world_rotation, FS_LIT(1.0));
    const fs_quaternion quaternion_product = fs_quaternion_product(&rotation_over, q);
    return fs_normalised(&quaternion_product);
}

/* error_state.py:64 */
void fs_write_vector(fs_real x[], int32_t at, const fs_vector3 *v)
{
    x[at] = v->x;
    x[at + 1] = v->y;
    x[at + 2] = v->z;
}

/* error_state.py:127 */
void fs_correct(fs_real x[], const fs_real error[27], fs_real share)
{
    const fs_vector3 read_vector = fs_read_vector(error, FS_ATTITUDE);
    const fs_vector3 turn = fs_scaled(&read_vector, share);
    const fs_quaternion q_2 = {x[0], x[1], x[2], x[3]};
    const fs_quaternion q = fs_turned(&q_2, &turn);
    x[0] = q.w;
    x[1] = q.x;
    x[2] = q.y;
    x[3] = q.z;
    for (int32_t i = 3; i < 27; i++) {
        x[i + 1] += share * error[i];
    }
}

/* error_state.py:70 */
fs_vector3 fs_sum_of(const fs_vector3 *a, const fs_vector3 *b)
{
    return (fs_vector3){a->x + b->x, a->y + b->y, a->z + b->z};
}

/* error_state.py:100 */
void fs_write_nominal(fs_real x[], const fs_nominal *n)
{
    x[0] = n->attitude.w;
    x[1] = n->attitude.x;
    x[2] = n->attitude.y;
    x[3] = n->attitude.z;
    fs_write_vector(x, 4, &n->velocity_ned_m_s);
    fs_write_vector(x, 7, &n->position_ned_m);
    fs_write_vector(x, 10, &n->gyro_bias_rad_s);
    fs_write_vector(x, 13, &n->accel_bias_m_s2);
    fs_write_vector(x, 16, &n->earth_field_ned_gauss);
    fs_write_vector(x, 19, &n->body_field_frd_gauss);
    x[22] = n->wind_north_m_s;
    x[23] = n->wind_east_m_s;
    x[24] = n->baro_bias_m;
    fs_write_vector(x, 25, &n->gnss_bias_ned_m);
}

/* error_state.py:120 */
fs_real fs_turn_between(const fs_quaternion *before, const fs_quaternion *after)
{
    const fs_quaternion conjugate = fs_conjugate(before);
    const fs_quaternion turn = fs_quaternion_product(after, &conjugate);
    return fs_wrap_pi(FS_LIT(2.0) * fs_atan2(turn.z, turn.w));
}
