/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Checks of the sensors against each other: accelerometer, gyro, barometer, GNSS velocity and GNSS position.
 * flightstack/estimation/source_checks.py
 */
#include "fs_source_checks.h"

#include "fs_geometry.h"
#include "fs_kalman.h"
#include "fs_math.h"

#define FS_ACCEL_DENSITY FS_LIT(1.0)
#define FS_VELOCITY 3
#define FS_ACCEL_BIAS_DENSITY FS_LIT(0.25)
#define FS_ACCEL_BIAS 12
#define FS_BARO_DENSITY FS_LIT(0.25)
#define FS_BARO_BIAS 23
#define FS_HEIGHT_DENSITY FS_LIT(0.1)
#define FS_POSITION 6
#define FS_REST_RATE 14
#define FS_GYRO_BIAS 9
#define FS_LEAST_VARIANCE FS_LIT(1e-12)
#define FS_LARGEST FS_LIT(3.0)
#define FS_MEAN_S FS_LIT(1.0)
#define FS_REST_SHARE FS_LIT(0.02)
#define FS_LIMIT FS_LIT(1.0)
#define FS_MOVED_RAD_S FS_LIT(0.01)
#define FS_MAG 7
#define FS_YAW_LIMIT_RAD FS_LIT(0.0175)
#define FS_YAW_MEAN_S FS_LIT(10.0)
#define FS_STRAIGHT_RAD_S FS_LIT(0.05)
#define FS_TURN_SHARE FS_LIT(0.8)
#define FS_STEP_S FS_LIT(2.0)
#define FS_ATTITUDE 0
#define FS_STEP_RAD_S FS_LIT(0.025)
#define FS_EQUAL_M FS_LIT(1e-09)
#define FS_STUCK_S FS_LIT(1.0)
#define FS_BARO 6
#define FS_MISSING_S FS_LIT(0.5)
#define FS_LONGEST_GAP_S FS_LIT(2.0)
#define FS_DRIFT_S FS_LIT(20.0)
#define FS_HEIGHT_MEAN_S FS_LIT(2.0)
#define FS_LARGEST_CHANGE_M FS_LIT(0.5)
#define FS_APART_M FS_LIT(1.5)
#define FS_CONSISTENT FS_LIT(0.0)
#define FS_SIDES FS_LIT(0.7)
#define FS_BARO_HOLD_S FS_LIT(10.0)
#define FS_SURELY_APART_M FS_LIT(2.0)
#define FS_VELOCITY_IS_WRONG FS_LIT(2.0)
#define FS_NOISE_SHARE FS_LIT(3.0)
#define FS_LEAST_ACCURACY_M FS_LIT(0.5)
#define FS_DRIFT_ACCURACIES FS_LIT(4.0)
#define FS_ONSET_LASTS_S FS_LIT(40.0)
#define FS_POSITION_DRIFTS FS_LIT(1.0)
#define FS_GNSS_VELOCITY 0
#define FS_GNSS_POSITION 3
#define FS_ACCEL_HOLD_S FS_LIT(1.0)
#define FS_SPEED_LIMIT FS_LIT(0.8)
#define FS_PLACE_LIMIT FS_LIT(0.3)
#define FS_STEPS_S FS_LIT(1.0)

/* source_checks.py:250 */
void fs_add_fault_noise(const fs_checks *c, fs_filter *f, fs_real dt_s)
{
    if (f->clock[0] < c->accel_until_s) {
        f->covariance[FS_VELOCITY + 2][FS_VELOCITY + 2] += FS_ACCEL_DENSITY * dt_s;
        f->covariance[FS_ACCEL_BIAS + 2][FS_ACCEL_BIAS + 2] += FS_ACCEL_BIAS_DENSITY * dt_s;
    }
    if (f->clock[0] < c->baro_until_s) {
        f->covariance[FS_BARO_BIAS][FS_BARO_BIAS] += FS_BARO_DENSITY * dt_s;
        /* it has moved with the barometer */
        f->covariance[FS_POSITION + 2][FS_POSITION + 2] += FS_HEIGHT_DENSITY * dt_s;
    }
}

/* Return a mean of innovations upwards with the newest one of a row. source_checks.py:131 */
static fs_real mean_(fs_real mean, const fs_filter *f, int32_t row, fs_real sign, fs_real dt_s)
{
    const fs_observed *o = &f->observations[row];
    const fs_real variance = fs_max(o->variance, FS_LEAST_VARIANCE); /* 0 before the first fusion */
    fs_real value = sign * o->innovation / fs_sqrt(variance);
    value = fs_min(fs_max(value, -FS_LARGEST), FS_LARGEST);
    const fs_real made = mean + fs_min(dt_s / FS_MEAN_S, FS_LIT(1.0)) * (value - mean);
    return made;
}

/* source_checks.py:170 */
void fs_take_rest_innovation(fs_checks *c, fs_filter *f, int32_t axis)
{
    fs_observed *o = &f->observations[FS_REST_RATE + axis];
    const int32_t at = FS_GYRO_BIAS + axis;
    f->covariance[at][at] = fs_max(f->covariance[at][at],
                                   o->noise * fs_correlation_factor(o) / fs_max(o->fused, FS_LIT(1.0)));
    c->rates[axis] = mean_(c->rates[axis], f, FS_REST_RATE + axis, FS_LIT(1.0), FS_REST_SHARE * FS_MEAN_S);
    if (fs_abs(c->rates[axis]) > FS_LIMIT && fs_abs(o->innovation) < FS_MOVED_RAD_S) {
        c->rates[axis] = FS_LIT(0.0);
        f->covariance[at][at] += FS_MOVED_RAD_S * FS_MOVED_RAD_S;
    }
}

/* source_checks.py:185 */
static fs_quaternion attitude(const fs_filter *f)
{
    return (fs_quaternion){f->nominal[0], f->nominal[1], f->nominal[2], f->nominal[3]};
}

/*
 * Add the uncertainty of a gyro whose bias about an axis of the body has stepped some time ago.
 *
 * Since then it has turned the attitude, and so the specific force of a vehicle that hardly accelerates: errors of
 * attitude, velocity and position are added as one with that of the bias. The filter learns it from each of them, and
 * stays as certain of the rest.
 *
 * source_checks.py:190
 */
static void doubt_gyro(fs_filter *f, int32_t axis, fs_real gravity)
{
    const fs_vector3 unit = {
        .x = axis == 0 ? FS_LIT(1.0) : FS_LIT(0.0),
        .y = axis == 1 ? FS_LIT(1.0) : FS_LIT(0.0),
        .z = axis == 2 ? FS_LIT(1.0) : FS_LIT(0.0),
    };
    const fs_quaternion attitude_ = attitude(f);
    const fs_vector3 about = fs_rotate(&attitude_, &unit);
    const fs_real turn = -FS_STEP_S;
    const fs_real speed = FS_LIT(0.5) * gravity * FS_STEP_S * FS_STEP_S;
    const fs_real place = speed * FS_STEP_S / FS_LIT(3.0);
    fs_clear(f->h);
    f->h[FS_ATTITUDE] = turn * about.x;
    f->h[FS_ATTITUDE + 1] = turn * about.y;
    f->h[FS_ATTITUDE + 2] = turn * about.z;
    f->h[FS_VELOCITY] = speed * about.y;
    f->h[FS_VELOCITY + 1] = -speed * about.x;
    f->h[FS_POSITION] = place * about.y;
    f->h[FS_POSITION + 1] = -place * about.x;
    f->h[FS_GYRO_BIAS + axis] = FS_LIT(1.0);
    for (int32_t i = 0; i < 27; i++) {
        const fs_real share = FS_STEP_RAD_S * FS_STEP_RAD_S * f->h[i];
        if (share != FS_LIT(0.0)) {
            for (int32_t j = i; j < 27; j++) {
                f->covariance[i][j] += share * f->h[j];
            }
        }
    }
}

/* source_checks.py:214 */
void fs_take_field_innovations(fs_checks *c, fs_filter *f, fs_real rate_rad_s, fs_real gravity)
{
    const fs_vector3 innovation = {
        .x = f->observations[FS_MAG].innovation,
        .y = f->observations[FS_MAG + 1].innovation,
        .z = f->observations[FS_MAG + 2].innovation,
    };
    const fs_quaternion attitude_ = attitude(f);
    const fs_vector3 off = fs_rotate(&attitude_, &innovation);
    const fs_real level = fs_sqrt(f->nominal[16] * f->nominal[16] + f->nominal[17] * f->nominal[17]) +
                          FS_LEAST_VARIANCE;
    const fs_real across = (f->nominal[17] * off.x - f->nominal[16] * off.y) / level;
    const fs_real yaw_rad = across / level;
    const fs_real change_s = fs_min(fs_max(f->clock[0] - c->field_s, FS_LIT(0.0)), FS_MEAN_S);
    const bool jumps = fs_abs(yaw_rad - c->yaw_now_rad) > FS_YAW_LIMIT_RAD || change_s >= FS_MEAN_S;
    c->field_s = f->clock[0];
    c->yaw_now_rad = yaw_rad;
    c->yaw_rad = jumps ? yaw_rad : c->yaw_rad + change_s / FS_MEAN_S * (yaw_rad - c->yaw_rad);
    c->yaw_then_rad += change_s / FS_YAW_MEAN_S * (c->yaw_rad - c->yaw_then_rad);
    if (jumps || fs_abs(rate_rad_s) > FS_STRAIGHT_RAD_S) {
        c->yaw_then_rad = c->yaw_rad;
    }
    const fs_real grown = c->yaw_rad - c->yaw_then_rad;
    const fs_real square = off.x * off.x + off.y * off.y + off.z * off.z;
    const bool is_turn = across * across > FS_TURN_SHARE * square && grown * c->yaw_rad > FS_LIT(0.0);
    if (fs_abs(grown) > FS_YAW_LIMIT_RAD && is_turn) {
        c->yaw_then_rad = c->yaw_rad;
        doubt_gyro(f, 2, gravity);
    }
}

/* source_checks.py:262 */
bool fs_is_stuck(fs_checks *c, fs_real altitude_m, fs_real now_s)
{
    if (fs_abs(altitude_m - c->altitude_m) > FS_EQUAL_M) {
        c->altitude_m = altitude_m;
        c->equal_since_s = now_s;
    }
    const fs_real equal_s = now_s - c->equal_since_s;
    return equal_s > FS_STUCK_S;
}

/* source_checks.py:142 */
void fs_take_pressure_innovation(fs_checks *c, const fs_filter *f, fs_real measured_s, fs_real altitude_m)
{
    c->pressure = mean_(c->pressure, f, FS_BARO, FS_LIT(1.0), fs_max(FS_LIT(0.0), measured_s - c->altitude_s));
    c->altitude_s = measured_s;
    c->altitude_now_m = altitude_m;
}

/*
 * Decide whether barometer or vertical GNSS velocity is wrong, beyond the noise of their drift. source_checks.py:322
 */
static void check_height(fs_checks *c, fs_real now_s, fs_real noise_m)
{
    const fs_real apart_m = fs_abs(c->baro_drift_m);
    const fs_real side = c->baro_drift_m > FS_LIT(0.0) ? c->height_drift_m : -c->height_drift_m;
    if (apart_m < FS_LIT(0.5) * fs_max(FS_APART_M, noise_m)) {
        c->fault[2] = FS_CONSISTENT;
    } else {
        if (apart_m > fs_max(FS_APART_M, noise_m) && side < FS_SIDES * apart_m) {
            c->baro_until_s = now_s + FS_BARO_HOLD_S;
            c->fault[2] = FS_CONSISTENT;
        } else {
            if (apart_m > fs_max(FS_SURELY_APART_M, noise_m)) {
                c->fault[2] = FS_VELOCITY_IS_WRONG;
            }
        }
    }
}

/* source_checks.py:300 */
void fs_follow_height_drift(fs_checks *c, const fs_real row[], bool flies, fs_real accuracy_m_s)
{
    const fs_real dt_s = row[0] - c->gnss_s;
    const fs_real altitude_m = c->altitude_now_m;
    const bool has_altitude = fs_abs(row[0] - c->altitude_s) < FS_MISSING_S;
    if (!flies || c->gnss_s == FS_LIT(0.0) || dt_s > FS_LONGEST_GAP_S) {
        c->drift_m[2] = FS_LIT(0.0);
        c->height_drift_m = FS_LIT(0.0);
        c->baro_drift_m = FS_LIT(0.0);
    } else {
        const fs_real kept = FS_LIT(1.0) - fs_min(dt_s / FS_DRIFT_S, FS_LIT(1.0));
        const fs_real moved_m = FS_LIT(0.5) * dt_s * (row[6] + c->velocity_m_s[2]);
        c->drift_m[2] = kept * c->drift_m[2] + row[3] - c->place_m[2] - moved_m;
        c->height_drift_m += fs_min(dt_s / FS_HEIGHT_MEAN_S, FS_LIT(1.0)) * (c->drift_m[2] - c->height_drift_m);
        fs_real change_m = c->had_altitude == FS_LIT(0.0) ? FS_LIT(0.0) : c->altitude_then_m - altitude_m - moved_m;
        change_m = fs_min(fs_max(change_m, -FS_LARGEST_CHANGE_M), FS_LARGEST_CHANGE_M);
        c->baro_drift_m = has_altitude ? kept * c->baro_drift_m + change_m : FS_LIT(0.0);
        check_height(c, row[0], FS_NOISE_SHARE * accuracy_m_s * fs_sqrt(FS_LIT(0.5) * FS_DRIFT_S * dt_s));
    }
    c->place_m[2] = row[3];
    c->velocity_m_s[2] = row[6];
    c->altitude_then_m = altitude_m;
    c->had_altitude = has_altitude ? FS_LIT(1.0) : FS_LIT(0.0);
}

/*
 * Decide which of GNSS position and velocity is wrong along an axis.
 *
 * A velocity that becomes wrong contradicts the inertial sensor at that time, a position that begins to drift does
 * not. A wrong velocity has moved position and velocity of the filter by as much as the drift, and has noise from now
 * on.
 *
 * source_checks.py:337
 */
static void start_fault(fs_checks *c, fs_filter *f, int32_t axis)
{
    const fs_real drift_m = c->drift_m[axis];
    const fs_real onset_s = c->onset_s[axis];
    const fs_real left_s = FS_ONSET_LASTS_S - (f->clock[0] - fs_abs(onset_s));
    if (fs_min(left_s, -onset_s * drift_m) > FS_LIT(0.0)) {
        c->fault[axis] = FS_VELOCITY_IS_WRONG;
        f->covariance[FS_VELOCITY + axis][FS_VELOCITY + axis] += drift_m * drift_m / (FS_DRIFT_S * FS_DRIFT_S);
        f->covariance[FS_POSITION + axis][FS_POSITION + axis] += drift_m * drift_m;
    } else {
        c->fault[axis] = FS_POSITION_DRIFTS;
    }
}

/*
 * Let the position become uncertain at the rate of the drift, for the velocity may be wrong instead.
 * source_checks.py:355
 */
static void doubt_position(const fs_checks *c, fs_filter *f, int32_t axis, fs_real dt_s)
{
    const int32_t at = FS_POSITION + axis;
    const fs_real grown_m = fs_sqrt(f->covariance[at][at]) + fs_abs(c->drift_m[axis]) / FS_DRIFT_S * dt_s;
    f->covariance[at][at] = grown_m * grown_m;
}

/* source_checks.py:271 */
void fs_follow_drift(fs_checks *c, fs_filter *f, const fs_real row[], fs_real eph_m)
{
    const fs_real dt_s = row[0] - c->gnss_s;
    const fs_real accuracy_m = fs_max(eph_m, FS_LEAST_ACCURACY_M);
    for (int32_t axis = 0; axis < 2; axis++) {
        const fs_real place = row[1 + axis];
        const fs_real speed = row[4 + axis];
        const fs_real fault = c->fault[axis];
        if (c->gnss_s == FS_LIT(0.0) || dt_s > FS_LONGEST_GAP_S) {
            c->drift_m[axis] = FS_LIT(0.0);
        } else {
            fs_real change = place - c->place_m[axis] - FS_LIT(0.5) * dt_s * (speed + c->velocity_m_s[axis]);
            change = fs_min(fs_max(change, -accuracy_m), accuracy_m);
            c->drift_m[axis] += change - fs_min(dt_s / FS_DRIFT_S, FS_LIT(1.0)) * c->drift_m[axis];
        }
        c->place_m[axis] = place;
        c->velocity_m_s[axis] = speed;
        const fs_real limit_m = FS_DRIFT_ACCURACIES * accuracy_m *
                                (fault == FS_CONSISTENT ? FS_LIT(1.0) : FS_LIT(0.5));
        if (fs_abs(c->drift_m[axis]) <= limit_m) {
            c->fault[axis] = FS_CONSISTENT;
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
    c->gnss_s = row[0];
}

/* source_checks.py:239 */
void fs_take_gnss_innovations(fs_checks *c, const fs_filter *f, fs_real dt_s, bool has_baro)
{
    c->speed = mean_(c->speed, f, FS_GNSS_VELOCITY + 2, FS_LIT(-1.0), dt_s);
    c->height = mean_(c->height, f, FS_GNSS_POSITION + 2, FS_LIT(-1.0), dt_s);
    const fs_real up = c->speed >= FS_LIT(0.0) ? FS_LIT(1.0) : FS_LIT(-1.0);
    const fs_real second = has_baro ? c->pressure : c->height;
    if (fs_min(up * c->speed, up * second) > FS_LIMIT) {
        c->accel_until_s = f->clock[0] + FS_ACCEL_HOLD_S;
    }
}

/* source_checks.py:149 */
void fs_take_horizontal_innovations(fs_checks *c, fs_filter *f, fs_real dt_s, fs_real gravity)
{
    bool is_wrong = false;
    for (int32_t axis = 0; axis < 2; axis++) {
        const fs_real mean = mean_(c->sideways[axis], f, FS_GNSS_VELOCITY + axis, FS_LIT(1.0), dt_s);
        const fs_real place = mean_(c->places[axis], f, FS_GNSS_POSITION + axis, FS_LIT(1.0), dt_s);
        c->sideways[axis] = mean;
        c->places[axis] = place;
        if (fs_abs(mean) > FS_LIMIT) {
            c->onset_s[axis] = mean > FS_LIT(0.0) ? f->clock[0] : -f->clock[0];
        }
        if (fs_abs(mean) > FS_SPEED_LIMIT && fs_abs(place) > FS_PLACE_LIMIT && mean * place > FS_LIT(0.0)) {
            is_wrong = true;
        }
    }
    if (is_wrong && f->clock[0] - c->gyro_s > FS_STEPS_S) {
        c->gyro_s = f->clock[0];
        for (int32_t axis = 0; axis < 2; axis++) {
            doubt_gyro(f, axis, gravity);
        }
    }
}

/* source_checks.py:363 */
bool fs_position_drifts(const fs_checks *c)
{
    const fs_real north = c->fault[0];
    const fs_real east = c->fault[1];
    return fs_min(fs_abs(north - FS_POSITION_DRIFTS), fs_abs(east - FS_POSITION_DRIFTS)) == FS_LIT(0.0);
}
