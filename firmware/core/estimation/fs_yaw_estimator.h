/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Yaw from GNSS velocity: a bank of models that start at yaws all around, weighed by how well each predicts velocity.
 * flightstack/estimation/yaw_estimator.py
 */
#ifndef FS_YAW_ESTIMATOR_H
#define FS_YAW_ESTIMATOR_H

#include "fs_types.h"

/* A Kalman filter of the bank. */
typedef struct {
    fs_real attitude[4];
    fs_real north_m_s;
    fs_real east_m_s;
    fs_real covariance[5][5];
    fs_real weight;
} fs_yaw_model;

/* All models; the sum of their weights is 1. */
typedef struct {
    fs_yaw_model models[5];
} fs_yaw_bank;

/* Return the attitude of a model. yaw_estimator.py:54 */
fs_quaternion fs_attitude_of(const fs_yaw_model *model);

/*
 * Move all models over a step: rotation vector and velocity change in the body frame, biases removed.
 * yaw_estimator.py:92
 */
void fs_predict_models(fs_yaw_bank *bank, const fs_vector3 *angle, const fs_vector3 *delta_velocity, fs_real dt_s);

/* Start with the tilt of attitude, yaws all around it, and a measured velocity. yaw_estimator.py:74 */
void fs_start_models(fs_yaw_bank *bank, const fs_quaternion *attitude, fs_real north_m_s, fs_real east_m_s,
                     fs_real variance);

/* Fuse a velocity with all models, and multiply the weight of each by its likelihood. yaw_estimator.py:148 */
void fs_update_models(fs_yaw_bank *bank, fs_real north_m_s, fs_real east_m_s, fs_real variance);

/* Return the angle [rad] about the vertical from attitude to the weighted mean of the models. yaw_estimator.py:164 */
fs_real fs_mean_turn(const fs_yaw_bank *bank, const fs_quaternion *attitude);

/* Return the variance [rad^2] of the models' yaw about turn_rad. yaw_estimator.py:176 */
fs_real fs_variance_of(const fs_yaw_bank *bank, const fs_quaternion *attitude, fs_real turn_rad);

/* Return the number of the model with the largest weight. yaw_estimator.py:187 */
int32_t fs_likeliest(const fs_yaw_bank *bank);

/* Return the variance [rad^2] of a model's tilt about north (0) or east (1). yaw_estimator.py:61 */
fs_real fs_tilt_variance(const fs_yaw_model *model, int32_t axis);

#endif
