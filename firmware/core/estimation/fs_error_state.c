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
#define FS_VELOCITY 3
#define FS_POSITION 6
#define FS_GYRO_BIAS 9
#define FS_ACCEL_BIAS 12
#define FS_EARTH_FIELD 15
#define FS_BODY_FIELD 18
#define FS_WIND 21
#define FS_BARO_BIAS 23
#define FS_GNSS_BIAS 24

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

/* error_state.py:70 */
fs_vector3 fs_sum_of(const fs_vector3 *a, const fs_vector3 *b)
{
    return (fs_vector3){a->x + b->x, a->y + b->y, a->z + b->z};
}

/* error_state.py:127 */
fs_nominal fs_corrected(const fs_nominal *n, const fs_real error[27])
{
    const fs_vector3 read_vector = fs_read_vector(error, FS_ATTITUDE);
    const fs_vector3 read_vector_2 = fs_read_vector(error, FS_VELOCITY);
    const fs_vector3 read_vector_3 = fs_read_vector(error, FS_POSITION);
    const fs_vector3 read_vector_4 = fs_read_vector(error, FS_GYRO_BIAS);
    const fs_vector3 read_vector_5 = fs_read_vector(error, FS_ACCEL_BIAS);
    const fs_vector3 read_vector_6 = fs_read_vector(error, FS_EARTH_FIELD);
    const fs_vector3 read_vector_7 = fs_read_vector(error, FS_BODY_FIELD);
    const fs_vector3 read_vector_8 = fs_read_vector(error, FS_GNSS_BIAS);
    return (fs_nominal){
        .attitude = fs_turned(&n->attitude, &read_vector),
        .velocity_ned_m_s = fs_sum_of(&n->velocity_ned_m_s, &read_vector_2),
        .position_ned_m = fs_sum_of(&n->position_ned_m, &read_vector_3),
        .gyro_bias_rad_s = fs_sum_of(&n->gyro_bias_rad_s, &read_vector_4),
        .accel_bias_m_s2 = fs_sum_of(&n->accel_bias_m_s2, &read_vector_5),
        .earth_field_ned_gauss = fs_sum_of(&n->earth_field_ned_gauss, &read_vector_6),
        .body_field_frd_gauss = fs_sum_of(&n->body_field_frd_gauss, &read_vector_7),
        .wind_north_m_s = n->wind_north_m_s + error[FS_WIND],
        .wind_east_m_s = n->wind_east_m_s + error[FS_WIND + 1],
        .baro_bias_m = n->baro_bias_m + error[FS_BARO_BIAS],
        .gnss_bias_ned_m = fs_sum_of(&n->gnss_bias_ned_m, &read_vector_8),
    };
}

/* error_state.py:120 */
fs_real fs_turn_between(const fs_quaternion *before, const fs_quaternion *after)
{
    const fs_quaternion conjugate = fs_conjugate(before);
    const fs_quaternion turn = fs_quaternion_product(after, &conjugate);
    return fs_wrap_pi(FS_LIT(2.0) * fs_atan2(turn.z, turn.w));
}
