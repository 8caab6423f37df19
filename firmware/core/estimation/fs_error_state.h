/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * States of the filter: the nominal state, and the layout of its error state. flightstack/estimation/error_state.py
 */
#ifndef FS_ERROR_STATE_H
#define FS_ERROR_STATE_H

#include "fs_types.h"

/* Nominal state of the filter; position relative to the origin of the local frame. */
typedef struct {
    fs_quaternion attitude;
    fs_vector3 velocity_ned_m_s;
    fs_vector3 position_ned_m;
    fs_vector3 gyro_bias_rad_s;
    fs_vector3 accel_bias_m_s2;
    fs_vector3 earth_field_ned_gauss;
    fs_vector3 body_field_frd_gauss;
    fs_real wind_north_m_s;
    fs_real wind_east_m_s;
    fs_real baro_bias_m;
    fs_vector3 gnss_bias_ned_m;
} fs_nominal;

/* Read three floats from index at. error_state.py:58 */
fs_vector3 fs_read_vector(const fs_real x[], int32_t at);

/* Return a times factor. error_state.py:76 */
fs_vector3 fs_scaled(const fs_vector3 *a, fs_real factor);

/* Read a Nominal from its array form, shape (28,). error_state.py:82 */
fs_nominal fs_read_nominal(const fs_real x[]);

/* Rotate an attitude by a rotation vector [rad] in the world frame. error_state.py:114 */
fs_quaternion fs_turned(const fs_quaternion *q, const fs_vector3 *world_rotation);

/* Write three floats to index at. error_state.py:64 */
void fs_write_vector(fs_real x[], int32_t at, const fs_vector3 *v);

/*
 * Add share of an error state, shape (27,), to the array form of the nominal state, shape (28,). error_state.py:127
 */
void fs_correct(fs_real x[], const fs_real error[27], fs_real share);

/* Vector sum. error_state.py:70 */
fs_vector3 fs_sum_of(const fs_vector3 *a, const fs_vector3 *b);

/* Write a Nominal in its array form, shape (28,). error_state.py:100 */
void fs_write_nominal(fs_real x[], const fs_nominal *n);

/* Return the angle [rad] about the vertical from one attitude to another. error_state.py:120 */
fs_real fs_turn_between(const fs_quaternion *before, const fs_quaternion *after);

#endif
