/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Checks of the sensors against each other: accelerometer, gyro, barometer, GNSS velocity and GNSS position.
 * flightstack/estimation/source_checks.py
 */
#ifndef FS_SOURCE_CHECKS_H
#define FS_SOURCE_CHECKS_H

#include "fs_kalman.h"
#include "fs_types.h"

/* What the checks remember of the sensors. */
typedef struct {
    fs_real speed;
    fs_real height;
    fs_real pressure;
    fs_real accel_until_s;
    fs_real baro_until_s;
    fs_real altitude_m;
    fs_real equal_since_s;
    fs_real gnss_s;
    fs_real place_m[3];
    fs_real velocity_m_s[3];
    fs_real drift_m[3];
    fs_real fault[3];
    fs_real baro_drift_m;
    fs_real sideways[2];
    fs_real places[2];
    fs_real gyro_s;
    fs_real rates[3];
    fs_real yaw_now_rad;
    fs_real yaw_rad;
    fs_real yaw_then_rad;
    fs_real field_s;
    fs_real onset_s[2];
    fs_real altitude_s;
    fs_real altitude_then_m;
    fs_real altitude_now_m;
    fs_real had_altitude;
    fs_real height_drift_m;
} fs_checks;

/*
 * Add the uncertainty of the sensors that count as wrong, so that the filter learns their error anew.
 * source_checks.py:250
 */
void fs_add_fault_noise(const fs_checks *c, fs_filter *f, fs_real dt_s);

/*
 * Take the innovation of the rate at rest: if its mean is beyond the noise, the bias is learnt anew.
 *
 * The bias is known no better than the mean of all rates with their present noise: a vehicle that sways looks like
 * one that stands, at first.
 *
 * source_checks.py:170
 */
void fs_take_rest_innovation(fs_checks *c, fs_filter *f, int32_t axis);

/*
 * Take the innovations of the magnetometer: if its yaw leaves the estimate without a turn, the gyro is wrong.
 *
 * A disturbed field jumps, or changes along other axes too.
 *
 * source_checks.py:214
 */
void fs_take_field_innovations(fs_checks *c, fs_filter *f, fs_real rate_rad_s, fs_real gravity);

/*
 * Return True if the barometer has repeated its altitude for 1 s; its noise changes each measurement.
 * source_checks.py:262
 */
bool fs_is_stuck(fs_checks *c, fs_real altitude_m, fs_real now_s);

/* Take the barometer's newest innovation, of an altitude measured at measured_s. source_checks.py:142 */
void fs_take_pressure_innovation(fs_checks *c, const fs_filter *f, fs_real measured_s, fs_real altitude_m);

/*
 * Compare the changes of height of GNSS and barometer with the vertical velocity of GNSS, over 20 s of flight.
 *
 * accuracy_m_s is that of the velocity, whose noise adds up.
 *
 * source_checks.py:300
 */
void fs_follow_height_drift(fs_checks *c, const fs_real row[], bool flies, fs_real accuracy_m_s);

/*
 * Compare the changes of the position of a GNSS measurement with its velocity, over 20 s.
 *
 * A horizontal axis has a fault above four times the accuracy that the receiver states, and until it is below half of
 * that. A jump counts as a change of one accuracy: the gate of the innovation refuses it. The barometer watches the
 * height.
 *
 * source_checks.py:271
 */
void fs_follow_drift(fs_checks *c, fs_filter *f, const fs_real row[], fs_real eph_m);

/* Take the vertical innovations of GNSS, and decide whether the accelerometer is wrong. source_checks.py:239 */
void fs_take_gnss_innovations(fs_checks *c, const fs_filter *f, fs_real dt_s, bool has_baro);

/*
 * Take the horizontal innovations of GNSS, and note when those of the velocity contradict the prediction.
 *
 * If those of the position do so alike, the gyro is wrong.
 *
 * source_checks.py:149
 */
void fs_take_horizontal_innovations(fs_checks *c, fs_filter *f, fs_real dt_s, fs_real gravity);

/* Return True if the GNSS position drifts from its velocity along an axis. source_checks.py:363 */
bool fs_position_drifts(const fs_checks *c);

#endif
