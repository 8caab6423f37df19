/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Accumulation of raw IMU samples to steps of the filter, with coning and sculling, and the noise of the samples.
 * flightstack/estimation/imu_input.py
 */
#include "fs_imu_input.h"

#include "fs_error_state.h"
#include "fs_geometry.h"
#include "fs_math.h"

#define FS_GAP_RATE_RAD_S FS_LIT(0.3)
#define FS_GAP_FORCE_M_S2 FS_LIT(3.0)
#define FS_UNKNOWN 53
#define FS_COUNT 14
#define FS_SMOOTHING_S FS_LIT(0.1)
#define FS_MEAN 8
#define FS_CLIPPED FS_LIT(0.99)
#define FS_SHOCK_RAD FS_LIT(0.1)
#define FS_SHOCK_M_S FS_LIT(5.0)
#define FS_PAIR_S 21
#define FS_PAIR 22
#define FS_PAIR_LENGTH_S FS_LIT(0.0155)
#define FS_NOISE_SMOOTHING_S FS_LIT(2.0)
#define FS_PAIRS 52
#define FS_PAST 28
#define FS_DIFFERENCE_VARIANCE FS_LIT(70.0)
#define FS_NOISE 15

/* imu_input.py:60 */
void fs_note_gap(fs_real sums[64], fs_real gap_s)
{
    const fs_real angle_rad = FS_GAP_RATE_RAD_S * gap_s;
    const fs_real speed_m_s = FS_GAP_FORCE_M_S2 * gap_s;
    sums[FS_UNKNOWN] += angle_rad * angle_rad;
    sums[FS_UNKNOWN + 1] += speed_m_s * speed_m_s;
}

/* imu_input.py:77 */
fs_vector3 fs_in_start_frame(const fs_vector3 *angle, const fs_vector3 *velocity)
{
    const fs_vector3 turn = fs_cross(angle, velocity);
    return (fs_vector3){
        .x = velocity->x + FS_LIT(0.5) * turn.x,
        .y = velocity->y + FS_LIT(0.5) * turn.y,
        .z = velocity->z + FS_LIT(0.5) * turn.z,
    };
}

/* imu_input.py:87 */
static void smooth(fs_real sums[64], int32_t at, const fs_vector3 *value, fs_real share)
{
    sums[at] += share * (value->x - sums[at]);
    sums[at + 1] += share * (value->y - sums[at + 1]);
    sums[at + 2] += share * (value->z - sums[at + 2]);
}

/* imu_input.py:42 */
void fs_add_sample(fs_real sums[64], const fs_vector3 *gyro, const fs_vector3 *accel, fs_real dt_s)
{
    const fs_vector3 angle = fs_scaled(gyro, dt_s);
    const fs_quaternion before = {sums[1], sums[2], sums[3], sums[4]};
    const fs_quaternion rotation_over = fs_rotation_over(&angle, FS_LIT(1.0));
    const fs_quaternion quaternion_product = fs_quaternion_product(&before, &rotation_over);
    const fs_quaternion after = fs_normalised(&quaternion_product);
    const fs_vector3 scaled = fs_scaled(accel, dt_s);
    const fs_vector3 in_start_frame = fs_in_start_frame(&angle, &scaled);
    const fs_vector3 dv = fs_rotate(&before, &in_start_frame);
    sums[0] += dt_s;
    sums[1] = after.w;
    sums[2] = after.x;
    sums[3] = after.y;
    sums[4] = after.z;
    sums[5] += dv.x;
    sums[6] += dv.y;
    sums[7] += dv.z;
    const fs_real share = sums[FS_COUNT] > FS_LIT(0.0) ? fs_min(dt_s / FS_SMOOTHING_S, FS_LIT(1.0)) : FS_LIT(1.0);
    smooth(sums, FS_MEAN, gyro, share);
    smooth(sums, FS_MEAN + 3, accel, share);
    sums[FS_COUNT] += FS_LIT(1.0);
}

/* imu_input.py:68 */
void fs_note_clipping(fs_real sums[64], const fs_vector3 *gyro, const fs_vector3 *accel,
                      const fs_estimator_params *params)
{
    if (fs_max(fs_max(fs_abs(gyro->x), fs_abs(gyro->y)), fs_abs(gyro->z)) >= FS_CLIPPED * params->gyro_range_rad_s) {
        sums[FS_UNKNOWN] += FS_SHOCK_RAD * FS_SHOCK_RAD;
    }
    if (fs_max(fs_max(fs_abs(accel->x), fs_abs(accel->y)), fs_abs(accel->z)) >= FS_CLIPPED *
        params->accel_range_m_s2) {
        sums[FS_UNKNOWN + 1] += FS_SHOCK_M_S * FS_SHOCK_M_S;
    }
}

/*
 * Update the noise densities from the fourth difference of means over two steps, 20 ms.
 *
 * The vehicle's motion has little power there, and vibration, which averages out within that time, does not count.
 *
 * imu_input.py:94
 */
static void measure_noise(fs_real sums[64], fs_real sample_dt_s, const fs_vector3 *angle, const fs_vector3 *velocity)
{
    sums[FS_PAIR_S] += sample_dt_s;
    sums[FS_PAIR] += angle->x;
    sums[FS_PAIR + 1] += angle->y;
    sums[FS_PAIR + 2] += angle->z;
    sums[FS_PAIR + 3] += velocity->x;
    sums[FS_PAIR + 4] += velocity->y;
    sums[FS_PAIR + 5] += velocity->z;
    const fs_real length_s = sums[FS_PAIR_S];
    if (length_s < FS_PAIR_LENGTH_S) {
        return;
    }
    const fs_real share = fs_max(fs_min(length_s / FS_NOISE_SMOOTHING_S, FS_LIT(1.0)),
                                 FS_LIT(1.0) / (sums[FS_PAIRS] > FS_LIT(3.0) ? sums[FS_PAIRS] - FS_LIT(2.0) :
                                                FS_LIT(2.0)));
    for (int32_t i = 0; i < 6; i++) {
        const fs_real mean = sums[FS_PAIR + i] / length_s;
        const int32_t at = FS_PAST + 4 * i;
        const fs_real fourth = mean - FS_LIT(4.0) * sums[at] + FS_LIT(6.0) * sums[at + 1] -
                               FS_LIT(4.0) * sums[at + 2] + sums[at + 3];
        if (sums[FS_PAIRS] >= FS_LIT(4.0)) {
            const fs_real density = fourth * fourth * (length_s / FS_DIFFERENCE_VARIANCE);
            sums[FS_NOISE + i] += share * (density - sums[FS_NOISE + i]);
        }
        const fs_real value = sums[at + 2];
        const fs_real value_2 = sums[at + 1];
        const fs_real value_3 = sums[at];
        const fs_real value_4 = mean;
        sums[at + 3] = value;
        sums[at + 2] = value_2;
        sums[at + 1] = value_3;
        sums[at] = value_4;
        sums[FS_PAIR + i] = FS_LIT(0.0);
    }
    sums[FS_PAIR_S] = FS_LIT(0.0);
    sums[FS_PAIRS] += FS_LIT(1.0);
}

/* imu_input.py:143 */
fs_delta_sample fs_take_step(fs_real sums[64], fs_real time_s)
{
    const fs_quaternion q = {sums[1], sums[2], sums[3], sums[4]};
    const fs_vector3 angle = fs_rotation_vector(&q);
    const fs_vector3 velocity = fs_read_vector(sums, 5);
    measure_noise(sums, sums[0], &angle, &velocity);
    const fs_delta_sample sample = {
        .time_s = time_s,
        .dt_s = sums[0],
        .angle_rad = angle,
        .velocity_m_s = velocity,
        .unknown_angle = sums[FS_UNKNOWN],
        .unknown_velocity = sums[FS_UNKNOWN + 1],
    };
    sums[FS_UNKNOWN] = FS_LIT(0.0);
    sums[FS_UNKNOWN + 1] = FS_LIT(0.0);
    for (int32_t i = 0; i < 8; i++) {
        sums[i] = FS_LIT(0.0);
    }
    sums[1] = FS_LIT(1.0);
    return sample;
}

/* imu_input.py:173 */
fs_delta_sample fs_read_step(const fs_real row[])
{
    return (fs_delta_sample){
        .time_s = row[0],
        .dt_s = row[1],
        .angle_rad = fs_read_vector(row, 2),
        .velocity_m_s = fs_read_vector(row, 5),
        .unknown_angle = row[8],
        .unknown_velocity = row[9],
    };
}

/* imu_input.py:137 */
fs_imu_noise fs_noise_of(const fs_real sums[64])
{
    return (fs_imu_noise){fs_read_vector(sums, FS_NOISE), fs_read_vector(sums, FS_NOISE + 3)};
}

/* imu_input.py:125 */
fs_vector3 fs_mean_rate(const fs_real sums[64])
{
    return fs_read_vector(sums, FS_MEAN);
}

/* imu_input.py:131 */
fs_vector3 fs_mean_force(const fs_real sums[64])
{
    return fs_read_vector(sums, FS_MEAN + 3);
}

/* imu_input.py:164 */
void fs_write_step(fs_real row[], const fs_delta_sample *sample)
{
    row[0] = sample->time_s;
    row[1] = sample->dt_s;
    fs_write_vector(row, 2, &sample->angle_rad);
    fs_write_vector(row, 5, &sample->velocity_m_s);
    row[8] = sample->unknown_angle;
    row[9] = sample->unknown_velocity;
}
