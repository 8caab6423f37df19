/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Parameters of the filter. flightstack/estimation/estimator_params.py */
#ifndef FS_ESTIMATOR_PARAMS_H
#define FS_ESTIMATOR_PARAMS_H

#include "fs_types.h"

/* Noise, gates and delays of the filter; SI units, 1sigma. *_noise_* are the least noise of a measurement. */
typedef struct {
    fs_real gyro_noise;
    fs_real accel_noise;
    fs_real imu_noise_share;
    fs_real gyro_scale_error;
    fs_real gyro_bias_walk;
    fs_real accel_bias_walk;
    fs_real earth_field_walk;
    fs_real body_field_walk;
    fs_real wind_walk;
    fs_real baro_walk;
    fs_real baro_dynamic_share;
    fs_real gyro_range_rad_s;
    fs_real accel_range_m_s2;
    fs_real tilt_rad;
    fs_real gyro_bias_rad_s;
    fs_real accel_bias_m_s2;
    fs_real earth_field_gauss;
    fs_real field_scale;
    fs_real body_field_gauss;
    fs_real declination_rad;
    fs_real gnss_delay_s;
    fs_real gnss_velocity_noise_m_s;
    fs_real gnss_position_noise_m;
    fs_real gnss_bias_share;
    fs_real gnss_bias_s;
    fs_real gnss_velocity_gate;
    fs_real gnss_position_gate;
    fs_real hold_noise_m;
    fs_real hold_velocity_m_s;
    fs_real baro_delay_s;
    fs_real baro_noise_m;
    fs_real baro_largest_noise_m;
    fs_real baro_gate;
    fs_real range_delay_s;
    fs_real range_noise_m;
    fs_real range_gate;
    fs_real drag_is_fused;
    fs_real drag_variance;
    fs_real ballistic_x_kg_m2;
    fs_real ballistic_y_kg_m2;
    fs_real momentum_drag_1_s;
    fs_real mag_delay_s;
    fs_real mag_noise_gauss;
    fs_real mag_largest_noise_gauss;
    fs_real mag_gate;
    fs_real mag_corrects_tilt;
    fs_real wind_m_s;
    fs_real rest_velocity_noise_m_s;
    fs_real rest_rate_noise_rad_s;
    fs_real delay_s;
    fs_real sensor_period_s;
    fs_real period_s;
    fs_real output_s;
    fs_real reset_s;
    fs_real gyro_cutoff_hz;
    fs_real gravity_m_s2;
} fs_estimator_params;

#endif
