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
#define FS_SMOOTHING_S FS_LIT(0.1)
#define FS_CLIPPED FS_LIT(0.99)
#define FS_SHOCK_RAD FS_LIT(0.1)
#define FS_SHOCK_M_S FS_LIT(5.0)
#define FS_PAIR_LENGTH_S FS_LIT(0.0155)
#define FS_NOISE_SMOOTHING_S FS_LIT(2.0)
#define FS_DIFFERENCE_VARIANCE FS_LIT(70.0)

/* imu_input.py:85 */
void fs_note_gap(fs_imu_sums *sums, fs_real gap_s)
{
    const fs_real angle_rad = FS_GAP_RATE_RAD_S * gap_s;
    const fs_real speed_m_s = FS_GAP_FORCE_M_S2 * gap_s;
    sums->unknown_angle += angle_rad * angle_rad;
    sums->unknown_velocity += speed_m_s * speed_m_s;
}

/* imu_input.py:102 */
fs_vector3 fs_in_start_frame(const fs_vector3 *angle, const fs_vector3 *velocity)
{
    const fs_vector3 turn = fs_cross(angle, velocity);
    return (fs_vector3){
        .x = velocity->x + FS_LIT(0.5) * turn.x,
        .y = velocity->y + FS_LIT(0.5) * turn.y,
        .z = velocity->z + FS_LIT(0.5) * turn.z,
    };
}

/* imu_input.py:112 */
static void smooth(fs_real mean[3], const fs_vector3 *value, fs_real share)
{
    mean[0] += share * (value->x - mean[0]);
    mean[1] += share * (value->y - mean[1]);
    mean[2] += share * (value->z - mean[2]);
}

/* imu_input.py:67 */
void fs_add_sample(fs_imu_sums *sums, const fs_vector3 *gyro, const fs_vector3 *accel, fs_real dt_s)
{
    const fs_vector3 angle = fs_scaled(gyro, dt_s);
    const fs_quaternion before = {
        .w = sums->rotation[0],
        .x = sums->rotation[1],
        .y = sums->rotation[2],
        .z = sums->rotation[3],
    };
    const fs_quaternion rotation_over = fs_rotation_over(&angle, FS_LIT(1.0));
    const fs_quaternion quaternion_product = fs_quaternion_product(&before, &rotation_over);
    const fs_quaternion after = fs_normalised(&quaternion_product);
    const fs_vector3 scaled = fs_scaled(accel, dt_s);
    const fs_vector3 in_start_frame = fs_in_start_frame(&angle, &scaled);
    const fs_vector3 dv = fs_rotate(&before, &in_start_frame);
    sums->elapsed_s += dt_s;
    sums->rotation[0] = after.w;
    sums->rotation[1] = after.x;
    sums->rotation[2] = after.y;
    sums->rotation[3] = after.z;
    sums->velocity_m_s[0] += dv.x;
    sums->velocity_m_s[1] += dv.y;
    sums->velocity_m_s[2] += dv.z;
    const fs_real share = sums->samples > FS_LIT(0.0) ? fs_min(dt_s / FS_SMOOTHING_S, FS_LIT(1.0)) : FS_LIT(1.0);
    smooth(sums->rate_rad_s, gyro, share);
    smooth(sums->force_m_s2, accel, share);
    sums->samples += FS_LIT(1.0);
}

/* imu_input.py:93 */
void fs_note_clipping(fs_imu_sums *sums, const fs_vector3 *gyro, const fs_vector3 *accel,
                      const fs_estimator_params *params)
{
    if (fs_max(fs_max(fs_abs(gyro->x), fs_abs(gyro->y)), fs_abs(gyro->z)) >= FS_CLIPPED * params->gyro_range_rad_s) {
        sums->unknown_angle += FS_SHOCK_RAD * FS_SHOCK_RAD;
    }
    if (fs_max(fs_max(fs_abs(accel->x), fs_abs(accel->y)), fs_abs(accel->z)) >= FS_CLIPPED *
        params->accel_range_m_s2) {
        sums->unknown_velocity += FS_SHOCK_M_S * FS_SHOCK_M_S;
    }
}

/*
 * Update the noise densities from the fourth difference of means over two steps, 20 ms.
 *
 * The vehicle's motion has little power there, and vibration, which averages out within that time, does not count.
 *
 * imu_input.py:119
 */
static void measure_noise(fs_imu_sums *sums, fs_real sample_dt_s, const fs_vector3 *angle, const fs_vector3 *velocity)
{
    const fs_real pairs = sums->pairs;
    sums->pair_s += sample_dt_s;
    sums->pair[0] += angle->x;
    sums->pair[1] += angle->y;
    sums->pair[2] += angle->z;
    sums->pair[3] += velocity->x;
    sums->pair[4] += velocity->y;
    sums->pair[5] += velocity->z;
    const fs_real length_s = sums->pair_s;
    if (length_s < FS_PAIR_LENGTH_S) {
        return;
    }
    const fs_real share = fs_max(fs_min(length_s / FS_NOISE_SMOOTHING_S, FS_LIT(1.0)),
                                 FS_LIT(1.0) / (pairs > FS_LIT(3.0) ? pairs - FS_LIT(2.0) : FS_LIT(2.0)));
    for (int32_t i = 0; i < 6; i++) {
        const fs_real mean = sums->pair[i] / length_s;
        const fs_real fourth = mean - FS_LIT(4.0) * sums->past[i][0] + FS_LIT(6.0) * sums->past[i][1] -
                               FS_LIT(4.0) * sums->past[i][2] + sums->past[i][3];
        if (pairs >= FS_LIT(4.0)) {
            const fs_real density = fourth * fourth * (length_s / FS_DIFFERENCE_VARIANCE);
            sums->noise[i] += share * (density - sums->noise[i]);
        }
        const fs_real value = sums->past[i][2];
        const fs_real value_2 = sums->past[i][1];
        const fs_real value_3 = sums->past[i][0];
        const fs_real value_4 = mean;
        sums->past[i][3] = value;
        sums->past[i][2] = value_2;
        sums->past[i][1] = value_3;
        sums->past[i][0] = value_4;
        sums->pair[i] = FS_LIT(0.0);
    }
    sums->pair_s = FS_LIT(0.0);
    sums->pairs += FS_LIT(1.0);
}

/* imu_input.py:167 */
fs_delta_sample fs_take_step(fs_imu_sums *sums, fs_real time_s)
{
    const fs_quaternion q_2 = {
        .w = sums->rotation[0],
        .x = sums->rotation[1],
        .y = sums->rotation[2],
        .z = sums->rotation[3],
    };
    const fs_vector3 angle = fs_rotation_vector(&q_2);
    const fs_vector3 velocity = fs_read_vector(sums->velocity_m_s, 0);
    measure_noise(sums, sums->elapsed_s, &angle, &velocity);
    const fs_delta_sample sample = {
        .time_s = time_s,
        .dt_s = sums->elapsed_s,
        .angle_rad = angle,
        .velocity_m_s = velocity,
        .unknown_angle = sums->unknown_angle,
        .unknown_velocity = sums->unknown_velocity,
    };
    sums->unknown_angle = FS_LIT(0.0);
    sums->unknown_velocity = FS_LIT(0.0);
    sums->elapsed_s = FS_LIT(0.0);
    sums->rotation[0] = FS_LIT(1.0);
    sums->rotation[1] = FS_LIT(0.0);
    sums->rotation[2] = FS_LIT(0.0);
    sums->rotation[3] = FS_LIT(0.0);
    sums->velocity_m_s[0] = FS_LIT(0.0);
    sums->velocity_m_s[1] = FS_LIT(0.0);
    sums->velocity_m_s[2] = FS_LIT(0.0);
    return sample;
}

/* imu_input.py:198 */
fs_delta_sample fs_read_step(const fs_step_row *row)
{
    return (fs_delta_sample){
        .time_s = row->time_s,
        .dt_s = row->dt_s,
        .angle_rad = fs_read_vector(row->angle_rad, 0),
        .velocity_m_s = fs_read_vector(row->velocity_m_s, 0),
        .unknown_angle = row->unknown_angle,
        .unknown_velocity = row->unknown_velocity,
    };
}

/* imu_input.py:161 */
fs_imu_noise fs_noise_of(const fs_imu_sums *sums)
{
    return (fs_imu_noise){fs_read_vector(sums->noise, 0), fs_read_vector(sums->noise, 3)};
}

/* imu_input.py:149 */
fs_vector3 fs_mean_rate(const fs_imu_sums *sums)
{
    return fs_read_vector(sums->rate_rad_s, 0);
}

/* imu_input.py:155 */
fs_vector3 fs_mean_force(const fs_imu_sums *sums)
{
    return fs_read_vector(sums->force_m_s2, 0);
}

/* imu_input.py:189 */
void fs_write_step(fs_step_row *row, const fs_delta_sample *sample)
{
    row->time_s = sample->time_s;
    row->dt_s = sample->dt_s;
    fs_write_vector(row->angle_rad, 0, &sample->angle_rad);
    fs_write_vector(row->velocity_m_s, 0, &sample->velocity_m_s);
    row->unknown_angle = sample->unknown_angle;
    row->unknown_velocity = sample->unknown_velocity;
}
