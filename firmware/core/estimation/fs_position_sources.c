/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Horizontal position and velocity: GNSS from its first fix to resets, and the position held without it.
 * flightstack/estimation/position_sources.py
 */
#include "fs_position_sources.h"

#include "fs_fusion.h"
#include "fs_height_sources.h"
#include "fs_kalman.h"
#include "fs_math.h"
#include "fs_resets.h"
#include "fs_source_checks.h"

#define FS_GNSS_VELOCITY 0
#define FS_GNSS_LOST_S FS_LIT(1.0)
#define FS_MOVES_M_S FS_LIT(0.15)
#define FS_VELOCITY 3
#define FS_NOTHING -1
#define FS_HOLD_PERIOD_S FS_LIT(0.2)
#define FS_POSITION 6
#define FS_GNSS_BIAS 24
#define FS_GNSS_POSITION 3
#define FS_YAW_STAGE 6
#define FS_COUNTED_M FS_LIT(0.5)
#define FS_LONGEST_INTERVAL_S FS_LIT(2.5)
#define FS_SPEED_SMOOTHING_S FS_LIT(2.0)

/* position_sources.py:170 */
bool fs_is_velocity_measured(const fs_filter *f)
{
    const fs_real fused_s = f->observations[FS_GNSS_VELOCITY].fused_s;
    return fused_s > FS_LIT(0.0) && f->clock[0] - fused_s < FS_GNSS_LOST_S;
}

/* position_sources.py:177 */
bool fs_is_platform_at_rest(const fs_estimator_memory *m, const fs_filter *f)
{
    const fs_real north = m->gnss_speed_m_s[0];
    const fs_real east = m->gnss_speed_m_s[1];
    const bool is_measured = m->flags.has_gnss == 1 && f->clock[0] - m->last_gnss_s < FS_GNSS_LOST_S;
    return !is_measured || fs_sqrt(north * north + east * east) < FS_MOVES_M_S;
}

/* position_sources.py:185 */
int32_t fs_hold_position(fs_estimator_memory *m, fs_filter *f, int32_t axis, const fs_estimator_params *params)
{
    fs_hold *hold = &m->hold;
    const fs_real now_s = f->clock[0];
    if (axis == 0) {
        const bool is_used = m->flags.has_gnss == 1 && m->flags.has_yaw == 1;
        if (fs_is_velocity_measured(f) || (is_used && fs_deviation(f, FS_VELOCITY, 2) < params->hold_velocity_m_s)) {
            hold->fused_s = FS_LIT(0.0);
            return FS_NOTHING;
        }
        if (hold->fused_s == FS_LIT(0.0)) {
            hold->place_m[0] = f->nominal[7];
            hold->place_m[1] = f->nominal[8];
        }
        if (now_s - hold->fused_s < FS_HOLD_PERIOD_S) {
            return FS_NOTHING;
        }
        hold->fused_s = now_s;
    }
    fs_fuse_hold(f, axis, hold->place_m[axis], params);
    return 1 - axis;
}

/*
 * Take the first velocity of GNSS as that of what the vehicle stands on: until then it counted as still.
 * position_sources.py:160
 */
static void start_platform(fs_estimator_memory *m, fs_filter *f, const fs_real row[])
{
    for (int32_t axis = 0; axis < 2; axis++) {
        m->gnss_speed_m_s[axis] = row[4 + axis];
    }
    if (!fs_is_platform_at_rest(m, f)) {
        for (int32_t axis = 0; axis < 2; axis++) {
            fs_reset_variance(f->covariance, FS_VELOCITY + axis, 1, row[4 + axis] * row[4 + axis]);
        }
    }
}

/*
 * Account for the errors of the first GNSS position, which becomes the origin, in the covariance.
 *
 * The slow part of that error is the bias of the next ones too: position and bias have opposite errors.
 *
 * position_sources.py:133
 */
static void start_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params)
{
    for (int32_t axis = 0; axis < 3; axis++) {
        const fs_real accuracy_m = axis == 2 ? fs_vertical_accuracy(row) : fs_horizontal_accuracy(row);
        const fs_real variance = accuracy_m * accuracy_m;
        const int32_t at = FS_POSITION + axis;
        const fs_real share = fs_gnss_bias_share(params, axis);
        const fs_real slow = fs_min(share * share, FS_LIT(1.0)) * variance;
        if (axis == 2) {
            /* the height is that above the ground, the altitude of the origin has the error of the fix */
            fs_reset_variance(f->covariance, FS_GNSS_BIAS + axis, 1, variance - slow);
        } else {
            f->covariance[at][at] += variance;
            fs_reset_variance(f->covariance, FS_GNSS_BIAS + axis, 1, slow);
            f->covariance[at][FS_GNSS_BIAS + axis] = -slow;
        }
    }
    m->last_gnss_s = row[0];
    m->flags.has_gnss = 1;
    if (m->flags.landed == 1) {
        start_platform(m, f, row);
    }
}

/*
 * Propagate what belongs to GNSS to the time of the measurement, and note the state before it. position_sources.py:74
 */
static void begin_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params)
{
    if (m->flags.has_gnss == 0) {
        start_gnss(m, f, row, params);
    }
    fs_before_gnss *before = &m->before_gnss;
    before->elapsed_s = fs_max(FS_LIT(0.0), row[0] - m->last_gnss_s);
    before->outage_s = f->clock[0] - f->observations[FS_GNSS_POSITION].fused_s;
    for (int32_t axis = 0; axis < 2; axis++) {
        const fs_real value = f->nominal[7 + axis];
        const fs_real value_2 = f->nominal[4 + axis];
        before->place_m[axis] = value;
        before->velocity_m_s[axis] = value_2;
    }
    m->last_gnss_s = row[0];
    fs_follow_height_drift(&m->checks, row, m->flags.landed == 0, fs_speed_accuracy(row));
    fs_follow_drift(&m->checks, f, row, fs_horizontal_accuracy(row));
    fs_drift_gnss_bias(f, row, before->elapsed_s, params);
}

/*
 * Add up the time between refused measurements; an accepted one ends it. Time without any does not count.
 * position_sources.py:119
 */
static void count_refused(fs_estimator_memory *m, const fs_filter *f, int32_t first, fs_real elapsed_s)
{
    for (int32_t i = 0; i < 6; i++) {
        const int32_t axis = i >= 3 ? i - 3 : i;
        if (axis < first || f->observations[FS_GNSS_VELOCITY + i].fused_s == f->clock[0]) {
            m->refused_s[i] = FS_LIT(0.0);
        } else {
            if (m->refused_s[i] == FS_LIT(0.0)) {
                m->refused_s[i] = FS_LIT(1e-06); /* the series begins */
            } else {
                m->refused_s[i] += elapsed_s;
            }
        }
    }
}

/* Check the measurement by its innovations, and reset what was refused too long. position_sources.py:90 */
static void end_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t first,
                     const fs_estimator_params *params)
{
    fs_before_gnss *before = &m->before_gnss;
    fs_checks *c = &m->checks;
    const fs_real elapsed_s = before->elapsed_s;
    if (m->flags.landed == 0) {
        fs_take_gnss_innovations(c, f, elapsed_s, m->flags.has_baro == 1);
        if (first == 0) {
            fs_take_horizontal_innovations(c, f, elapsed_s, params->gravity_m_s2);
        }
    }
    const fs_real dx = f->nominal[7] - before->place_m[0];
    const fs_real dy = f->nominal[8] - before->place_m[1];
    if (before->outage_s > FS_GNSS_LOST_S && dx * dx + dy * dy > FS_COUNTED_M * FS_COUNTED_M) {
        fs_count_correction(m, f, dx, dy, f->nominal[4] - before->velocity_m_s[0],
                            f->nominal[5] - before->velocity_m_s[1]);
    }
    count_refused(m, f, first, fs_min(elapsed_s, FS_LONGEST_INTERVAL_S));
    const fs_real share = fs_min(elapsed_s / FS_SPEED_SMOOTHING_S, FS_LIT(1.0));
    for (int32_t axis = 0; axis < 2; axis++) {
        m->gnss_speed_m_s[axis] += share * (row[4 + axis] - m->gnss_speed_m_s[axis]);
    }
    const fs_real limit_s = params->reset_s;
    const fs_real velocity_s = fs_max(m->refused_s[0], m->refused_s[1]);
    const fs_real position_s = fs_max(m->refused_s[3], m->refused_s[4]);
    if (velocity_s > limit_s) {
        fs_reset_velocity(m, f, row, 0, 2);
    }
    if (velocity_s > limit_s || (position_s > limit_s && !fs_position_drifts(c))) {
        fs_reset_position(m, f, row, 0, 2);
    }
    if (m->refused_s[2] > limit_s) {
        fs_reset_velocity(m, f, row, 2, 1);
    }
    if (m->refused_s[5] > limit_s) {
        fs_reset_height(m, f, row);
    }
}

/* position_sources.py:52 */
int32_t fs_take_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t stage,
                     const fs_estimator_params *params)
{
    const int32_t first = m->flags.has_yaw == 1 ? 0 : 2;
    int32_t at = stage;
    if (stage == 0) {
        begin_gnss(m, f, row, params);
        at = first;
    }
    const int32_t axis = at < 3 ? at : at - 3;
    const fs_real fault = m->checks.fault[axis];
    if (at < 3) {
        fs_fuse_gnss_velocity(f, row, axis, fault, params);
    } else {
        fs_fuse_gnss_position(f, row, f->clock[0] - row[0], axis, fault, params);
    }
    if (at == FS_YAW_STAGE - 1) {
        end_gnss(m, f, row, first, params);
    }
    return at != 2 ? at + 1 : 3 + first;
}
