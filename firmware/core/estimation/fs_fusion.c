/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Fusion of each sensor's measurements at the delayed horizon. flightstack/estimation/fusion.py */
#include "fs_fusion.h"

#include "fs_derived_generated.h"
#include "fs_error_state.h"
#include "fs_kalman.h"
#include "fs_math.h"

#define FS_MAG_START FS_LIT(25.0)
#define FS_SLOW FS_LIT(2.0)
#define FS_GNSS_VELOCITY 0
#define FS_AIDED_S FS_LIT(1.0)
#define FS_HOLDS_TILT_AND_GYRO FS_LIT(3.0)
#define FS_HOLDS_TILT FS_LIT(1.0)
#define FS_MAG 7
#define FS_WHITE FS_LIT(0.0)
#define FS_VELOCITY 3
#define FS_REST_VELOCITY 11
#define FS_CORRELATED FS_LIT(1.0)
#define FS_GYRO_BIAS 9
#define FS_REST_RATE 14
#define FS_POSITION 6
#define FS_HOLD_POSITION 17
#define FS_DRAG_GATE FS_LIT(5.0)
#define FS_AIR_KG_M3 FS_LIT(1.225)
#define FS_DRAG 23
#define FS_BARO_BIAS 23
#define FS_BARO 6
#define FS_HOLDS_HORIZONTAL FS_LIT(2.0)
#define FS_RANGE 10
#define FS_UNKNOWN_M_S FS_LIT(0.5)
#define FS_UNKNOWN_VERTICAL_M FS_LIT(8.0)
#define FS_UNKNOWN_M FS_LIT(5.0)
#define FS_BARO_LOST_S FS_LIT(5.0)
#define FS_GNSS_BIAS 24
#define FS_HEIGHT_RETURN_S FS_LIT(1800.0)
#define FS_VELOCITY_IS_WRONG FS_LIT(2.0)
#define FS_WRONG_VELOCITY_M_S FS_LIT(2.0)
#define FS_CONFIRMATION FS_LIT(0.02)
#define FS_LEAST_SHARE FS_LIT(0.01)
#define FS_POSITION_DRIFTS FS_LIT(1.0)
#define FS_GNSS_POSITION 3

/* Return True if GNSS measures the horizontal motion. fusion.py:165 */
static bool is_aided(const fs_filter *f)
{
    const fs_real age_s = f->clock[0] - f->observations[FS_GNSS_VELOCITY].fused_s;
    return age_s < FS_AIDED_S;
}

/* fusion.py:205 */
void fs_fuse_field_axis(fs_filter *f, int32_t axis, const fs_vector3 *measured, const fs_estimator_params *params)
{
    const fs_real least = params->mag_noise_gauss;
    const fs_real largest = params->mag_largest_noise_gauss;
    const fs_noise noise = {
        .least = least,
        .start = fs_min(FS_MAG_START * least, largest),
        .largest = largest,
        .gate = params->mag_gate,
        .kind = FS_SLOW,
    };
    const fs_nominal n = fs_read_nominal(f->nominal);
    const fs_vector3 *earth = &n.earth_field_ned_gauss;
    const fs_vector3 *body = &n.body_field_frd_gauss;
    fs_clear(f->h);
    fs_real expected;
    fs_real innovation;
    if (axis == 0) {
        expected = fs_field_x_jacobian(&n.attitude, earth, body, f->h);
        innovation = measured->x - expected;
    } else {
        if (axis == 1) {
            expected = fs_field_y_jacobian(&n.attitude, earth, body, f->h);
            innovation = measured->y - expected;
        } else {
            expected = fs_field_z_jacobian(&n.attitude, earth, body, f->h);
            innovation = measured->z - expected;
        }
    }
    const fs_real held = is_aided(f) ? FS_HOLDS_TILT_AND_GYRO : FS_HOLDS_TILT;
    (void)fs_fuse(f, FS_MAG + axis, innovation, &noise, params->mag_corrects_tilt > FS_LIT(0.0) ? FS_LIT(0.0) : held);
}

/* fusion.py:230 */
int32_t fs_axis_by_yaw(const fs_vector3 *measured, int32_t at)
{
    if (at == 2 || fs_abs(measured->y) > fs_abs(measured->x)) {
        return at;
    }
    return 1 - at;
}

/* fusion.py:242 */
void fs_fuse_field(fs_filter *f, const fs_vector3 *measured, const fs_estimator_params *params)
{
    for (int32_t at = 0; at < 3; at++) {
        fs_fuse_field_axis(f, fs_axis_by_yaw(measured, at), measured, params);
    }
}

/* fusion.py:274 */
void fs_fuse_rest_velocity(fs_filter *f, int32_t axis, const fs_estimator_params *params)
{
    const fs_real velocity = params->rest_velocity_noise_m_s;
    const fs_noise noise = {velocity, velocity, velocity, FS_LIT(5.0), FS_WHITE};
    fs_clear(f->h);
    f->h[FS_VELOCITY + axis] = FS_LIT(1.0);
    (void)fs_fuse(f, FS_REST_VELOCITY + axis, -f->nominal[4 + axis], &noise, FS_LIT(0.0));
}

/* fusion.py:284 */
void fs_fuse_rest_rate(fs_filter *f, int32_t axis, const fs_vector3 *rate_rad_s, fs_real variance,
                       const fs_estimator_params *params)
{
    const fs_real least = fs_sqrt(variance);
    const fs_real largest = params->rest_rate_noise_rad_s + least;
    const fs_noise noise = {least, largest, largest, FS_LIT(3.0), FS_CORRELATED};
    fs_clear(f->h);
    f->h[FS_GYRO_BIAS + axis] = FS_LIT(1.0);
    const fs_real value = axis == 0 ? rate_rad_s->x : (axis == 1 ? rate_rad_s->y : rate_rad_s->z);
    (void)fs_fuse(f, FS_REST_RATE + axis, value - f->nominal[10 + axis], &noise, FS_LIT(0.0));
}

/* fusion.py:301 */
void fs_fuse_hold(fs_filter *f, int32_t axis, fs_real held_m, const fs_estimator_params *params)
{
    const fs_noise noise = {
        .least = params->hold_noise_m,
        .start = params->hold_noise_m,
        .largest = params->hold_noise_m,
        .gate = FS_LIT(100.0),
        .kind = FS_WHITE,
    };
    fs_clear(f->h);
    f->h[FS_POSITION + axis] = FS_LIT(1.0);
    (void)fs_fuse(f, FS_HOLD_POSITION + axis, held_m - f->nominal[7 + axis], &noise, FS_LIT(0.0));
}

/* fusion.py:249 */
void fs_fuse_drag(fs_filter *f, int32_t axis, const fs_vector3 *force, const fs_estimator_params *params)
{
    const fs_real deviation = fs_sqrt(params->drag_variance);
    const fs_noise noise = {deviation, deviation, deviation, FS_DRAG_GATE, FS_WHITE};
    const fs_nominal n = fs_read_nominal(f->nominal);
    const fs_vector3 *v = &n.velocity_ned_m_s;
    const fs_vector3 *bias = &n.accel_bias_m_s2;
    const fs_real north = n.wind_north_m_s;
    const fs_real east = n.wind_east_m_s;
    const fs_real speed = fs_sqrt((v->x - north) * (v->x - north) + (v->y - east) * (v->y - east) + v->z * v->z);
    const fs_real ballistic = axis == 0 ? params->ballistic_x_kg_m2 : params->ballistic_y_kg_m2;
    const fs_real rate = params->momentum_drag_1_s +
                         (ballistic > FS_LIT(0.0) ? FS_LIT(0.5) * FS_AIR_KG_M3 * speed / ballistic : FS_LIT(0.0));
    fs_clear(f->h);
    fs_real expected;
    fs_real innovation;
    if (axis == 0) {
        expected = fs_drag_x_jacobian(&n.attitude, v, bias, north, east, rate, f->h);
        innovation = force->x - expected;
    } else {
        expected = fs_drag_y_jacobian(&n.attitude, v, bias, north, east, rate, f->h);
        innovation = force->y - expected;
    }
    (void)fs_fuse(f, FS_DRAG + axis, innovation, &noise, FS_LIT(0.0));
}

/* fusion.py:172 */
void fs_fuse_baro(fs_filter *f, fs_real altitude_m, fs_real age_s, const fs_estimator_params *params)
{
    fs_clear(f->h);
    f->h[FS_POSITION + 2] = FS_LIT(-1.0);
    f->h[FS_BARO_BIAS] = FS_LIT(1.0);
    const fs_real predicted_m = -(f->nominal[9] - age_s * f->nominal[6]) + f->nominal[24];
    const fs_noise noise = {
        .least = params->baro_noise_m,
        .start = FS_LIT(1.0),
        .largest = params->baro_largest_noise_m,
        .gate = params->baro_gate,
        .kind = FS_CORRELATED,
    };
    (void)fs_fuse(f, FS_BARO, altitude_m - predicted_m, &noise, is_aided(f) ? FS_LIT(0.0) : FS_HOLDS_HORIZONTAL);
}

/* fusion.py:187 */
fs_real fs_cos_tilt_of(const fs_filter *f)
{
    const fs_real x = f->nominal[1];
    const fs_real y = f->nominal[2];
    const fs_real cosine = FS_LIT(1.0) - FS_LIT(2.0) * (x * x + y * y);
    return cosine;
}

/* fusion.py:195 */
void fs_fuse_range(fs_filter *f, fs_real vertical_m, fs_real ground_m, fs_real age_s,
                   const fs_estimator_params *params)
{
    fs_clear(f->h);
    f->h[FS_POSITION + 2] = FS_LIT(-1.0);
    const fs_real height_m = ground_m - (f->nominal[9] - age_s * f->nominal[6]);
    const fs_noise noise = {
        .least = params->range_noise_m,
        .start = params->range_noise_m,
        .largest = FS_LIT(1.0),
        .gate = params->range_gate,
        .kind = FS_WHITE,
    };
    (void)fs_fuse(f, FS_RANGE, vertical_m - height_m, &noise, FS_LIT(0.0));
}

/* Return an accuracy that a receiver states; unknown if it states none. Zero is an ideal receiver's. fusion.py:70 */
static fs_real stated(fs_real accuracy, fs_real unknown)
{
    return fs_is_finite(accuracy) && accuracy >= FS_LIT(0.0) ? accuracy : unknown;
}

/* fusion.py:88 */
fs_real fs_speed_accuracy(const fs_real row[10])
{
    return stated(row[9], FS_UNKNOWN_M_S);
}

/* fusion.py:82 */
fs_real fs_vertical_accuracy(const fs_real row[10])
{
    return stated(row[8], FS_UNKNOWN_VERTICAL_M);
}

/* fusion.py:76 */
fs_real fs_horizontal_accuracy(const fs_real row[10])
{
    return stated(row[7], FS_UNKNOWN_M);
}

/* fusion.py:94 */
fs_real fs_gnss_bias_share(const fs_estimator_params *params, int32_t axis)
{
    return params->gnss_bias_share * (axis == 2 ? fs_sqrt(FS_LIT(2.0)) : FS_LIT(1.0));
}

/* fusion.py:100 */
void fs_drift_gnss_bias(fs_filter *f, const fs_real row[10], fs_real elapsed_s, const fs_estimator_params *params)
{
    const fs_real eph_m = fs_horizontal_accuracy(row);
    const fs_real epv_m = fs_vertical_accuracy(row);
    const fs_real kept = fs_max(FS_LIT(0.0), FS_LIT(1.0) - elapsed_s / params->gnss_bias_s);
    const bool has_baro = f->clock[0] - f->observations[FS_BARO].fused_s < FS_BARO_LOST_S;
    for (int32_t at = 24; at < 27; at++) {
        const fs_real spread = fs_gnss_bias_share(params, at - FS_GNSS_BIAS) *
                               (at == FS_GNSS_BIAS + 2 ? epv_m : eph_m);
        const fs_real return_s = has_baro && at == FS_GNSS_BIAS + 2 ? FS_HEIGHT_RETURN_S : params->gnss_bias_s;
        const fs_real left = fs_max(FS_LIT(0.0), FS_LIT(1.0) - elapsed_s / return_s);
        f->nominal[at + 1] *= left;
        for (int32_t j = 0; j < at + 1; j++) {
            f->covariance[j][at] *= left;
        }
        for (int32_t j = at; j < 27; j++) {
            f->covariance[at][j] *= left;
        }
        f->covariance[at][at] += (FS_LIT(1.0) - kept * kept) * spread * spread;
    }
}

/*
 * Adapt the share of the measured IMU noise that counts, so that innovations have their predicted variance.
 *
 * Fast motion and vibration look like noise of the IMU, but do not add up to an error of the velocity.
 *
 * fusion.py:123
 */
static void confirm_imu_noise(fs_filter *f, int32_t row)
{
    fs_observed *o = &f->observations[row];
    const fs_real ratio = fs_min(o->innovation * o->innovation / o->variance, FS_LIT(6.0));
    f->clock[1] = fs_min(fs_max(f->clock[1] * (FS_LIT(1.0) + FS_CONFIRMATION * (ratio - FS_LIT(1.0))),
                                FS_LEAST_SHARE), FS_LIT(1.0));
}

/* fusion.py:134 */
void fs_fuse_gnss_velocity(fs_filter *f, const fs_real row[10], int32_t axis, fs_real fault,
                           const fs_estimator_params *params)
{
    const fs_real speed_m_s = fs_speed_accuracy(row);
    const fs_real least = fault == FS_VELOCITY_IS_WRONG ? FS_WRONG_VELOCITY_M_S : params->gnss_velocity_noise_m_s;
    const fs_noise noise = {
        .least = least,
        .start = speed_m_s,
        .largest = fs_max(FS_LIT(2.0) * speed_m_s, least),
        .gate = params->gnss_velocity_gate,
        .kind = FS_WHITE,
    };
    fs_clear(f->h);
    f->h[FS_VELOCITY + axis] = FS_LIT(1.0);
    const bool accepted = fs_fuse(f, FS_GNSS_VELOCITY + axis, row[4 + axis] - f->nominal[4 + axis], &noise,
                                  FS_LIT(0.0));
    if (accepted && fault != FS_VELOCITY_IS_WRONG) {
        confirm_imu_noise(f, FS_GNSS_VELOCITY + axis);
    }
}

/* fusion.py:147 */
void fs_fuse_gnss_position(fs_filter *f, const fs_real row[10], fs_real age_s, int32_t axis, fs_real fault,
                           const fs_estimator_params *params)
{
    if (fault == FS_POSITION_DRIFTS) {
        f->observations[FS_GNSS_POSITION + axis].refused += FS_LIT(1.0);
        return;
    }
    const fs_real accuracy_m = axis == 2 ? fs_vertical_accuracy(row) : fs_horizontal_accuracy(row);
    const fs_real least = params->gnss_position_noise_m;
    const fs_noise noise = {
        .least = least,
        .start = accuracy_m,
        .largest = fs_max(FS_LIT(2.0) * accuracy_m, least),
        .gate = params->gnss_position_gate,
        .kind = FS_WHITE,
    };
    fs_clear(f->h);
    f->h[FS_POSITION + axis] = FS_LIT(1.0);
    f->h[FS_GNSS_BIAS + axis] = FS_LIT(1.0);
    const fs_real then_m = f->nominal[7 + axis] - age_s * f->nominal[4 + axis];
    (void)fs_fuse(f, FS_GNSS_POSITION + axis, row[1 + axis] - then_m - f->nominal[25 + axis], &noise, FS_LIT(0.0));
}
