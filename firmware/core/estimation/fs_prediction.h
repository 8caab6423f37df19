/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Prediction of the filter's state and covariance with one accumulated IMU sample.
 * flightstack/estimation/prediction.py
 */
#ifndef FS_PREDICTION_H
#define FS_PREDICTION_H

#include "fs_error_state.h"
#include "fs_estimator_params.h"
#include "fs_kalman.h"
#include "fs_types.h"

/* Rotation vector and velocity change over dt_s, in the body frame at its start, biases included. */
typedef struct {
    fs_real time_s;
    fs_real dt_s;
    fs_vector3 angle_rad;
    fs_vector3 velocity_m_s;
    fs_real unknown_angle;
    fs_real unknown_velocity;
} fs_delta_sample;

/* Attitude, velocity and position. */
typedef struct {
    fs_quaternion attitude;
    fs_vector3 velocity_ned_m_s;
    fs_vector3 position_ned_m;
} fs_motion;

/* Densities of the white noise that is measured of each axis, [rad^2/s] and [m^2/s^3]. */
typedef struct {
    fs_vector3 gyro;
    fs_vector3 accel;
} fs_imu_noise;

/* Return the part of the nominal state that moves. prediction.py:95 */
fs_motion fs_motion_of(const fs_nominal *n);

/* Return a delta angle or velocity without the bias of its rate. prediction.py:75 */
fs_vector3 fs_less_bias(const fs_vector3 *v, const fs_vector3 *bias, fs_real dt_s);

/*
 * Integrate one step: angle and delta_velocity in the body frame at the start, velocity by trapezoids.
 * prediction.py:81
 */
fs_motion fs_moved(const fs_motion *start, const fs_vector3 *angle, const fs_vector3 *delta_velocity, fs_real dt_s,
                   fs_real gravity);

/* Return the nominal state with another motion. prediction.py:101 */
fs_nominal fs_with_motion(const fs_nominal *n, const fs_motion *motion);

/* Propagate the state over the sample. The covariance is behind it until predict_errors. prediction.py:238 */
void fs_predict(fs_filter *f, const fs_delta_sample *sample, const fs_estimator_params *params);

/*
 * Propagate the covariance to the time of the state, over all samples since it was last.
 *
 * The errors then move with the attitude in the middle of that time.
 *
 * prediction.py:254
 */
void fs_predict_errors(fs_filter *f, const fs_imu_noise *noise, const fs_estimator_params *params);

/*
 * Add the uncertainty of what the sensor could not measure in a step; the position has half of the velocity's.
 * prediction.py:270
 */
void fs_add_unknown(fs_filter *f, const fs_delta_sample *step);

#endif
