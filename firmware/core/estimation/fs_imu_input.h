/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Accumulation of raw IMU samples to steps of the filter, with coning and sculling, and the noise of the samples.
 * flightstack/estimation/imu_input.py
 */
#ifndef FS_IMU_INPUT_H
#define FS_IMU_INPUT_H

#include "fs_estimator_params.h"
#include "fs_prediction.h"
#include "fs_types.h"

/* Note a time without samples, which the next sample bridges. imu_input.py:60 */
void fs_note_gap(fs_real sums[64], fs_real gap_s);

/*
 * Return a sample's change of the velocity in the frame at its start, to first order of its rotation vector.
 *
 * The mean specific force acts in the attitude in the middle of the sample.
 *
 * imu_input.py:77
 */
fs_vector3 fs_in_start_frame(const fs_vector3 *angle, const fs_vector3 *velocity);

/* Add one raw sample. imu_input.py:42 */
void fs_add_sample(fs_real sums[64], const fs_vector3 *gyro, const fs_vector3 *accel, fs_real dt_s);

/* Note a sample with a value at the end of its range: the true one may be far larger. imu_input.py:68 */
void fs_note_clipping(fs_real sums[64], const fs_vector3 *gyro, const fs_vector3 *accel,
                      const fs_estimator_params *params);

/* Return the accumulated step that ends at time_s, and start the next one. imu_input.py:143 */
fs_delta_sample fs_take_step(fs_real sums[64], fs_real time_s);

/* Read a step from a row of the IMU ring. imu_input.py:173 */
fs_delta_sample fs_read_step(const fs_real row[]);

/* Return the noise that is measured of the sensor. imu_input.py:137 */
fs_imu_noise fs_noise_of(const fs_real sums[64]);

/* Return the rate [rad/s], smoothed over 0.1 s. imu_input.py:125 */
fs_vector3 fs_mean_rate(const fs_real sums[64]);

/* Return the specific force [m/s^2], smoothed over 0.1 s. imu_input.py:131 */
fs_vector3 fs_mean_force(const fs_real sums[64]);

/* Write a step to a row of the IMU ring, shape (10,). imu_input.py:164 */
void fs_write_step(fs_real row[], const fs_delta_sample *sample);

#endif
