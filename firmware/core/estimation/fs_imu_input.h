/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Accumulation of raw IMU samples to steps of the filter, with coning and sculling, and the noise of the samples.
 * flightstack/estimation/imu_input.py
 */
#ifndef FS_IMU_INPUT_H
#define FS_IMU_INPUT_H

#include "fs_estimator_params.h"
#include "fs_prediction.h"
#include "fs_rings.h"
#include "fs_types.h"

/* Sums of the samples since the last step, and what is known of the sensor. */
typedef struct {
    fs_real elapsed_s;
    fs_real rotation[4];
    fs_real velocity_m_s[3];
    fs_real rate_rad_s[3];
    fs_real force_m_s2[3];
    fs_real samples;
    fs_real unknown_angle;
    fs_real unknown_velocity;
    fs_real noise[6];
    fs_real pair_s;
    fs_real pair[6];
    fs_real past[6][4];
    fs_real pairs;
} fs_imu_sums;

/* Note a time without samples, which the next sample bridges. imu_input.py:85 */
void fs_note_gap(fs_imu_sums *sums, fs_real gap_s);

/*
 * Return a sample's change of the velocity in the frame at its start, to first order of its rotation vector.
 *
 * The mean specific force acts in the attitude in the middle of the sample.
 *
 * imu_input.py:102
 */
fs_vector3 fs_in_start_frame(const fs_vector3 *angle, const fs_vector3 *velocity);

/* Add one raw sample. imu_input.py:67 */
void fs_add_sample(fs_imu_sums *sums, const fs_vector3 *gyro, const fs_vector3 *accel, fs_real dt_s);

/* Note a sample with a value at the end of its range: the true one may be far larger. imu_input.py:93 */
void fs_note_clipping(fs_imu_sums *sums, const fs_vector3 *gyro, const fs_vector3 *accel,
                      const fs_estimator_params *params);

/* Return the accumulated step that ends at time_s, and start the next one. imu_input.py:167 */
fs_delta_sample fs_take_step(fs_imu_sums *sums, fs_real time_s);

/* Read a step from a row of the IMU ring. imu_input.py:198 */
fs_delta_sample fs_read_step(const fs_step_row *row);

/* Return the noise that is measured of the sensor. imu_input.py:161 */
fs_imu_noise fs_noise_of(const fs_imu_sums *sums);

/* Return the rate [rad/s], smoothed over 0.1 s. imu_input.py:149 */
fs_vector3 fs_mean_rate(const fs_imu_sums *sums);

/* Return the specific force [m/s^2], smoothed over 0.1 s. imu_input.py:155 */
fs_vector3 fs_mean_force(const fs_imu_sums *sums);

/* Write a step to a row of the IMU ring. imu_input.py:189 */
void fs_write_step(fs_step_row *row, const fs_delta_sample *sample);

#endif
