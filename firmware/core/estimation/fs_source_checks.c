/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Checks of the sensors against each other: accelerometer, barometer, GNSS velocity and GNSS position.
 * flightstack/estimation/source_checks.py
 */
#include "fs_source_checks.h"

#include "fs_math.h"

#define FS_ACCEL_UNTIL_S 3
#define FS_ACCEL_DENSITY FS_LIT(1.0)
#define FS_VELOCITY 3
#define FS_ACCEL_BIAS_DENSITY FS_LIT(0.25)
#define FS_ACCEL_BIAS 12
#define FS_BARO_UNTIL_S 4
#define FS_BARO_DENSITY FS_LIT(0.25)
#define FS_BARO_BIAS 23
#define FS_HEIGHT_DENSITY FS_LIT(0.1)
#define FS_POSITION 6
#define FS_ALTITUDE 5
#define FS_EQUAL_M FS_LIT(1e-09)
#define FS_EQUAL_SINCE_S 6
#define FS_STUCK_S FS_LIT(1.0)
#define FS_INNOVATION_VARIANCE 1
#define FS_LEAST_VARIANCE FS_LIT(1e-12)
#define FS_INNOVATION 0
#define FS_LARGEST FS_LIT(3.0)
#define FS_MEAN_S FS_LIT(1.0)
#define FS_PRESSURE 2
#define FS_BARO 6
#define FS_ALTITUDE_S 25
#define FS_ALTITUDE_NOW 27
#define FS_GNSS_S 7
#define FS_MISSING_S FS_LIT(0.5)
#define FS_LONGEST_GAP_S FS_LIT(2.0)
#define FS_DRIFT 14
#define FS_HEIGHT_DRIFT 29
#define FS_BARO_DRIFT 20
#define FS_DRIFT_S FS_LIT(20.0)
#define FS_MOTION 11
#define FS_PLACE 8
#define FS_HEIGHT_MEAN_S FS_LIT(2.0)
#define FS_HAD_ALTITUDE 28
#define FS_ALTITUDE_THEN 26
#define FS_LARGEST_CHANGE_M FS_LIT(0.5)
#define FS_APART_M FS_LIT(1.5)
#define FS_CONSISTENT FS_LIT(0.0)
#define FS_GNSS_FAULT 17
#define FS_SIDES FS_LIT(0.7)
#define FS_BARO_HOLD_S FS_LIT(10.0)
#define FS_SURELY_APART_M FS_LIT(2.0)
#define FS_VELOCITY_IS_WRONG FS_LIT(2.0)
#define FS_NOISE_SHARE FS_LIT(3.0)
#define FS_LEAST_ACCURACY_M FS_LIT(0.5)
#define FS_DRIFT_ACCURACIES FS_LIT(4.0)
#define FS_ONSET_S 23
#define FS_ONSET_LASTS_S FS_LIT(40.0)
#define FS_POSITION_DRIFTS FS_LIT(1.0)
#define FS_SPEED 0
#define FS_GNSS_VELOCITY 0
#define FS_HEIGHT 1
#define FS_GNSS_POSITION 3
#define FS_LIMIT FS_LIT(1.0)
#define FS_ACCEL_HOLD_S FS_LIT(1.0)
#define FS_SIDEWAYS 21

/* source_checks.py:104 */
void fs_add_fault_noise(const fs_real c[30], fs_filter *f, fs_real dt_s)
{
    if (f->clock[0] < c[FS_ACCEL_UNTIL_S]) {
        f->covariance[FS_VELOCITY + 2][FS_VELOCITY + 2] += FS_ACCEL_DENSITY * dt_s;
        f->covariance[FS_ACCEL_BIAS + 2][FS_ACCEL_BIAS + 2] += FS_ACCEL_BIAS_DENSITY * dt_s;
    }
    if (f->clock[0] < c[FS_BARO_UNTIL_S]) {
        f->covariance[FS_BARO_BIAS][FS_BARO_BIAS] += FS_BARO_DENSITY * dt_s;
        /* it has moved with the barometer */
        f->covariance[FS_POSITION + 2][FS_POSITION + 2] += FS_HEIGHT_DENSITY * dt_s;
    }
}

/* source_checks.py:116 */
bool fs_is_stuck(fs_real c[30], fs_real altitude_m, fs_real now_s)
{
    if (fs_abs(altitude_m - c[FS_ALTITUDE]) > FS_EQUAL_M) {
        c[FS_ALTITUDE] = altitude_m;
        c[FS_EQUAL_SINCE_S] = now_s;
    }
    const fs_real equal_s = now_s - c[FS_EQUAL_SINCE_S];
    return equal_s > FS_STUCK_S;
}

/* Add the newest innovation of a row to its mean, upwards. source_checks.py:68 */
static void take(fs_real c[30], int32_t at, const fs_filter *f, int32_t row, fs_real sign, fs_real dt_s)
{
    /* 0 before the first fusion */
    const fs_real variance = fs_max(f->observations[row][FS_INNOVATION_VARIANCE], FS_LEAST_VARIANCE);
    fs_real value = sign * f->observations[row][FS_INNOVATION] / fs_sqrt(variance);
    value = fs_min(fs_max(value, -FS_LARGEST), FS_LARGEST);
    c[at] += fs_min(dt_s / FS_MEAN_S, FS_LIT(1.0)) * (value - c[at]);
}

/* source_checks.py:77 */
void fs_take_pressure_innovation(fs_real c[30], const fs_filter *f, fs_real measured_s, fs_real altitude_m)
{
    take(c, FS_PRESSURE, f, FS_BARO, FS_LIT(1.0), fs_max(FS_LIT(0.0), measured_s - c[FS_ALTITUDE_S]));
    c[FS_ALTITUDE_S] = measured_s;
    c[FS_ALTITUDE_NOW] = altitude_m;
}

/*
 * Decide whether barometer or vertical GNSS velocity is wrong, beyond the noise of their drift. source_checks.py:176
 */
static void judge_height(fs_real c[30], fs_real now_s, fs_real noise_m)
{
    const fs_real apart_m = fs_abs(c[FS_BARO_DRIFT]);
    const fs_real side = c[FS_BARO_DRIFT] > FS_LIT(0.0) ? c[FS_HEIGHT_DRIFT] : -c[FS_HEIGHT_DRIFT];
    if (apart_m < FS_LIT(0.5) * fs_max(FS_APART_M, noise_m)) {
        c[FS_GNSS_FAULT + 2] = FS_CONSISTENT;
    } else {
        if (apart_m > fs_max(FS_APART_M, noise_m) && side < FS_SIDES * apart_m) {
            c[FS_BARO_UNTIL_S] = now_s + FS_BARO_HOLD_S;
            c[FS_GNSS_FAULT + 2] = FS_CONSISTENT;
        } else {
            if (apart_m > fs_max(FS_SURELY_APART_M, noise_m)) {
                c[FS_GNSS_FAULT + 2] = FS_VELOCITY_IS_WRONG;
            }
        }
    }
}

/* source_checks.py:154 */
void fs_follow_height_drift(fs_real c[30], const fs_real row[], bool flies, fs_real accuracy_m_s)
{
    const fs_real dt_s = row[0] - c[FS_GNSS_S];
    const fs_real altitude_m = c[FS_ALTITUDE_NOW];
    const bool has_altitude = fs_abs(row[0] - c[FS_ALTITUDE_S]) < FS_MISSING_S;
    if (!flies || c[FS_GNSS_S] == FS_LIT(0.0) || dt_s > FS_LONGEST_GAP_S) {
        c[FS_DRIFT + 2] = FS_LIT(0.0);
        c[FS_HEIGHT_DRIFT] = FS_LIT(0.0);
        c[FS_BARO_DRIFT] = FS_LIT(0.0);
    } else {
        const fs_real kept = FS_LIT(1.0) - fs_min(dt_s / FS_DRIFT_S, FS_LIT(1.0));
        const fs_real moved_m = FS_LIT(0.5) * dt_s * (row[6] + c[FS_MOTION + 2]);
        c[FS_DRIFT + 2] = kept * c[FS_DRIFT + 2] + row[3] - c[FS_PLACE + 2] - moved_m;
        c[FS_HEIGHT_DRIFT] += fs_min(dt_s / FS_HEIGHT_MEAN_S, FS_LIT(1.0)) * (c[FS_DRIFT + 2] - c[FS_HEIGHT_DRIFT]);
        fs_real change_m = c[FS_HAD_ALTITUDE] == FS_LIT(0.0) ? FS_LIT(0.0) :
                           c[FS_ALTITUDE_THEN] - altitude_m - moved_m;
        change_m = fs_min(fs_max(change_m, -FS_LARGEST_CHANGE_M), FS_LARGEST_CHANGE_M);
        c[FS_BARO_DRIFT] = has_altitude ? kept * c[FS_BARO_DRIFT] + change_m : FS_LIT(0.0);
        judge_height(c, row[0], FS_NOISE_SHARE * accuracy_m_s * fs_sqrt(FS_LIT(0.5) * FS_DRIFT_S * dt_s));
    }
    c[FS_PLACE + 2] = row[3];
    c[FS_MOTION + 2] = row[6];
    c[FS_ALTITUDE_THEN] = altitude_m;
    c[FS_HAD_ALTITUDE] = has_altitude ? FS_LIT(1.0) : FS_LIT(0.0);
}

/*
 * Decide which of GNSS position and velocity is wrong along an axis.
 *
 * A velocity that becomes wrong contradicts the inertial sensor at that time, a position that begins to drift does
 * not. A wrong velocity has moved position and velocity of the filter by as much as the drift, and has noise from now
 * on.
 *
 * source_checks.py:188
 */
static void start_fault(fs_real c[30], fs_filter *f, int32_t axis)
{
    const fs_real drift_m = c[FS_DRIFT + axis];
    const fs_real onset_s = c[FS_ONSET_S + axis];
    const fs_real left_s = FS_ONSET_LASTS_S - (f->clock[0] - fs_abs(onset_s));
    if (fs_min(left_s, -onset_s * drift_m) > FS_LIT(0.0)) {
        c[FS_GNSS_FAULT + axis] = FS_VELOCITY_IS_WRONG;
        f->covariance[FS_VELOCITY + axis][FS_VELOCITY + axis] += drift_m * drift_m / (FS_DRIFT_S * FS_DRIFT_S);
        f->covariance[FS_POSITION + axis][FS_POSITION + axis] += drift_m * drift_m;
    } else {
        c[FS_GNSS_FAULT + axis] = FS_POSITION_DRIFTS;
    }
}

/*
 * Let the position become uncertain at the rate of the drift, for the velocity may be wrong instead.
 * source_checks.py:206
 */
static void doubt_position(const fs_real c[30], fs_filter *f, int32_t axis, fs_real dt_s)
{
    const int32_t at = FS_POSITION + axis;
    const fs_real grown_m = fs_sqrt(f->covariance[at][at]) + fs_abs(c[FS_DRIFT + axis]) / FS_DRIFT_S * dt_s;
    f->covariance[at][at] = grown_m * grown_m;
}

/* source_checks.py:125 */
void fs_follow_drift(fs_real c[30], fs_filter *f, const fs_real row[], fs_real eph_m)
{
    const fs_real dt_s = row[0] - c[FS_GNSS_S];
    const fs_real accuracy_m = fs_max(eph_m, FS_LEAST_ACCURACY_M);
    for (int32_t axis = 0; axis < 2; axis++) {
        const fs_real place = row[1 + axis];
        const fs_real speed = row[4 + axis];
        const fs_real fault = c[FS_GNSS_FAULT + axis];
        if (c[FS_GNSS_S] == FS_LIT(0.0) || dt_s > FS_LONGEST_GAP_S) {
            c[FS_DRIFT + axis] = FS_LIT(0.0);
        } else {
            fs_real change = place - c[FS_PLACE + axis] - FS_LIT(0.5) * dt_s * (speed + c[FS_MOTION + axis]);
            change = fs_min(fs_max(change, -accuracy_m), accuracy_m);
            c[FS_DRIFT + axis] += change - fs_min(dt_s / FS_DRIFT_S, FS_LIT(1.0)) * c[FS_DRIFT + axis];
        }
        c[FS_PLACE + axis] = place;
        c[FS_MOTION + axis] = speed;
        const fs_real limit_m = FS_DRIFT_ACCURACIES * accuracy_m *
                                (fault == FS_CONSISTENT ? FS_LIT(1.0) : FS_LIT(0.5));
        if (fs_abs(c[FS_DRIFT + axis]) <= limit_m) {
            c[FS_GNSS_FAULT + axis] = FS_CONSISTENT;
        } else {
            if (fault == FS_CONSISTENT) {
                start_fault(c, f, axis);
            } else {
                if (fault == FS_POSITION_DRIFTS) {
                    doubt_position(c, f, axis, dt_s);
                }
            }
        }
    }
    c[FS_GNSS_S] = row[0];
}

/* source_checks.py:93 */
void fs_take_gnss_innovations(fs_real c[30], const fs_filter *f, fs_real dt_s, bool has_baro)
{
    take(c, FS_SPEED, f, FS_GNSS_VELOCITY + 2, FS_LIT(-1.0), dt_s);
    take(c, FS_HEIGHT, f, FS_GNSS_POSITION + 2, FS_LIT(-1.0), dt_s);
    const fs_real up = c[FS_SPEED] >= FS_LIT(0.0) ? FS_LIT(1.0) : FS_LIT(-1.0);
    const fs_real second = has_baro ? c[FS_PRESSURE] : c[FS_HEIGHT];
    if (fs_min(up * c[FS_SPEED], up * second) > FS_LIMIT) {
        c[FS_ACCEL_UNTIL_S] = f->clock[0] + FS_ACCEL_HOLD_S;
    }
}

/* source_checks.py:84 */
void fs_take_horizontal_innovations(fs_real c[30], const fs_filter *f, fs_real dt_s)
{
    for (int32_t axis = 0; axis < 2; axis++) {
        take(c, FS_SIDEWAYS + axis, f, FS_GNSS_VELOCITY + axis, FS_LIT(1.0), dt_s);
        if (fs_abs(c[FS_SIDEWAYS + axis]) > FS_LIMIT) {
            c[FS_ONSET_S + axis] = c[FS_SIDEWAYS + axis] > FS_LIT(0.0) ? f->clock[0] : -f->clock[0];
        }
    }
}

/* source_checks.py:214 */
bool fs_position_drifts(const fs_real c[30])
{
    const fs_real north = c[FS_GNSS_FAULT];
    const fs_real east = c[FS_GNSS_FAULT + 1];
    return fs_min(fs_abs(north - FS_POSITION_DRIFTS), fs_abs(east - FS_POSITION_DRIFTS)) == FS_LIT(0.0);
}
