/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The filter's work in parts: a prediction, then one scalar measurement at a time, so that no sample waits for all.
 * flightstack/estimation/agenda.py
 */
#include "fs_agenda.h"

#include "fs_error_state.h"
#include "fs_fusion.h"
#include "fs_height_sources.h"
#include "fs_imu_input.h"
#include "fs_math.h"
#include "fs_output_predictor.h"
#include "fs_position_sources.h"
#include "fs_prediction.h"
#include "fs_resets.h"
#include "fs_rings.h"
#include "fs_source_checks.h"
#include "fs_yaw_sources.h"

#define FS_IDLE 0
#define FS_IMU_RING 4
#define FS_REST_PERIOD_S FS_LIT(0.1)
#define FS_BEHIND_S FS_LIT(0.035)
#define FS_MAG_RING 1
#define FS_BARO_RING 2
#define FS_RANGE_RING 3
#define FS_GNSS_RING 0
#define FS_EARTH_SOURCE 1
#define FS_SOURCES 9
#define FS_REST_SOURCE 2
#define FS_STILL_FORCE_M_S2 FS_LIT(1.0)
#define FS_STILL_RATE_RAD_S FS_LIT(0.08)
#define FS_NOTHING -1
#define FS_REST_MEAN_S FS_LIT(0.1)
#define FS_HOLD_SOURCE 3
#define FS_DRAG_SOURCE 8
#define FS_DRAG_PERIOD_S FS_LIT(0.05)
#define FS_GAP_S FS_LIT(0.2)
#define FS_LATE_S FS_LIT(0.3)
#define FS_GAP_LATE_S FS_LIT(0.02)
#define FS_MAG_SOURCE 4
#define FS_MAG_ROWS 32
#define FS_BARO_SOURCE 5
#define FS_BARO_ROWS 32
#define FS_RANGE_SOURCE 6
#define FS_RANGE_ROWS 32
#define FS_GNSS_ROWS 8
#define FS_YAW_STAGE 6
#define FS_IMU_ROWS 64

/*
 * Return True if a measurement may be fused in the step at hand, or the covariance is behind by the most.
 * agenda.py:151
 */
static bool is_covariance_due(const fs_estimator_memory *m, const fs_filter *f, const fs_rings *r,
                              const fs_estimator_params *params)
{
    const fs_real now_s = f->clock[0];
    const bool rests = m->flags.landed == 1 && now_s - m->rest_s >= FS_REST_PERIOD_S;
    const bool is_asked = rests || m->flags.field_is_new == 1;
    if (f->behind[0] > FS_BEHIND_S || is_asked || params->drag_is_fused > FS_LIT(0.0) ||
        !fs_is_velocity_measured(f)) {
        return true;
    }
    return fs_is_due(r, FS_MAG_RING, r->mag[fs_oldest_slot(r, FS_MAG_RING)], now_s) ||
           fs_is_due(r, FS_BARO_RING, r->baro[fs_oldest_slot(r, FS_BARO_RING)], now_s) ||
           fs_is_due(r, FS_RANGE_RING, r->range[fs_oldest_slot(r, FS_RANGE_RING)], now_s) ||
           fs_is_due(r, FS_GNSS_RING, r->gnss[fs_oldest_slot(r, FS_GNSS_RING)], now_s);
}

/* Predict a step that is not later than the horizon; return False if there is none. agenda.py:131 */
static bool begin(fs_estimator_memory *m, fs_filter *f, const fs_rings *r, fs_real horizon_s,
                  const fs_estimator_params *params)
{
    fs_agenda *agenda = &m->agenda;
    if (fs_count_of(r, FS_IMU_RING) == 0) {
        return false;
    }
    const int32_t slot = fs_oldest_slot(r, FS_IMU_RING);
    if (r->imu[slot].time_s > horizon_s) {
        return false;
    }
    const fs_delta_sample step = fs_read_step(&r->imu[slot]);
    fs_predict_yaw(m, f, &step);
    fs_predict(f, &step, params);
    if (is_covariance_due(m, f, r, params)) {
        const fs_imu_noise noise_of = fs_noise_of(&m->sums);
        fs_predict_errors(f, &noise_of, params);
    }
    fs_add_unknown(f, &step);
    fs_add_fault_noise(&m->checks, f, step.dt_s);
    agenda->source = FS_EARTH_SOURCE;
    agenda->axis = 0;
    agenda->has_fused = 0;
    return true;
}

/* Return True if the vehicle is on the ground and nothing moves it. agenda.py:255 */
static bool stands(const fs_estimator_memory *m, const fs_estimator_params *params)
{
    if (m->flags.landed == 0) {
        return false;
    }
    const fs_vector3 rate = fs_mean_rate(&m->sums);
    const fs_vector3 force = fs_mean_force(&m->sums);
    const fs_vector3 bias = fs_read_vector(m->filter.nominal, 10);
    const fs_real off = fs_sqrt(force.x * force.x + force.y * force.y + force.z * force.z) - params->gravity_m_s2;
    const fs_real largest = fs_max(fs_max(fs_abs(rate.x - bias.x), fs_abs(rate.y - bias.y)), fs_abs(rate.z - bias.z));
    return fs_abs(off) < FS_STILL_FORCE_M_S2 && largest < FS_STILL_RATE_RAD_S;
}

/* Fuse the rate at rest; a platform that moves turns too, so slowly that it looks like a bias. agenda.py:284 */
static void rest_rate(fs_estimator_memory *m, fs_filter *f, int32_t axis, const fs_estimator_params *params)
{
    const fs_imu_noise noise_of = fs_noise_of(&m->sums);
    const fs_vector3 noise = noise_of.gyro;
    const fs_real density = axis == 0 ? noise.x : (axis == 1 ? noise.y : noise.z);
    const fs_real sways = fs_is_platform_at_rest(m, f) ? FS_LIT(0.0) : params->rest_rate_noise_rad_s;
    const fs_vector3 mean_rate = fs_mean_rate(&m->sums);
    fs_fuse_rest_rate(f, axis, &mean_rate, density / FS_REST_MEAN_S + sways * sways, params);
    fs_take_rest_innovation(&m->checks, f, axis);
}

/* Fuse rest ten times a second: three axes of the velocity, three of the rate. agenda.py:267 */
static int32_t rest(fs_estimator_memory *m, fs_filter *f, const fs_rings *r, int32_t stage,
                    const fs_estimator_params *params)
{
    (void)r;
    int32_t axis = stage;
    if (stage == 0) {
        if (f->clock[0] - m->rest_s < FS_REST_PERIOD_S || !stands(m, params)) {
            return FS_NOTHING;
        }
        m->rest_s = f->clock[0];
        if (!fs_is_platform_at_rest(m, f)) {
            axis = 3;
        }
    }
    if (axis < 3) {
        fs_fuse_rest_velocity(f, axis, params);
    } else {
        rest_rate(m, f, axis - 3, params);
    }
    return axis < 5 ? axis + 1 : 0;
}

/* Fuse drag in flight while the velocity over ground is measured, twenty times a second. agenda.py:294 */
static int32_t drag(fs_estimator_memory *m, fs_filter *f, const fs_rings *r, int32_t axis,
                    const fs_estimator_params *params)
{
    if (axis == 0) {
        const bool waits = f->clock[0] - m->drag_s < FS_DRAG_PERIOD_S;
        if (params->drag_is_fused == FS_LIT(0.0) || m->flags.landed == 1 || waits || !fs_is_velocity_measured(f)) {
            return FS_NOTHING;
        }
        m->drag_s = f->clock[0];
    }
    const fs_delta_sample step = fs_read_step(&r->imu[fs_oldest_slot(r, FS_IMU_RING)]);
    const fs_vector3 scaled = fs_scaled(&step.velocity_m_s, FS_LIT(1.0) / step.dt_s);
    fs_fuse_drag(f, axis, &scaled, params);
    return 1 - axis;
}

/* Move the oldest row of a ring to row; return False if none is due. agenda.py:245 */
static bool next_row(fs_rings *r, int32_t ring, int32_t size, const fs_real oldest[], int32_t oldest_size,
                     fs_real now_s, fs_real row[])
{
    if (!fs_is_due(r, ring, oldest, now_s)) {
        return false;
    }
    fs_read_row(oldest, oldest_size, row);
    fs_pop(r, ring, size);
    return true;
}

/* Move the oldest row of a source that is due to pending; drop those that are too late. agenda.py:224 */
static bool take_row(fs_estimator_memory *m, const fs_filter *f, fs_rings *r, int32_t source)
{
    const fs_real now_s = f->clock[0];
    const fs_real late_s = r->imu[fs_oldest_slot(r, FS_IMU_RING)].dt_s < FS_GAP_S ? FS_LATE_S : FS_GAP_LATE_S;
    for (int32_t count = 0; count < 32; count++) {
        bool found;
        if (source == FS_MAG_SOURCE) {
            found = next_row(r, FS_MAG_RING, FS_MAG_ROWS, r->mag[fs_oldest_slot(r, FS_MAG_RING)], 4, now_s,
                             m->pending);
        } else {
            if (source == FS_BARO_SOURCE) {
                found = next_row(r, FS_BARO_RING, FS_BARO_ROWS, r->baro[fs_oldest_slot(r, FS_BARO_RING)], 2, now_s,
                                 m->pending);
            } else {
                if (source == FS_RANGE_SOURCE) {
                    found = next_row(r, FS_RANGE_RING, FS_RANGE_ROWS, r->range[fs_oldest_slot(r, FS_RANGE_RING)], 2,
                                     now_s, m->pending);
                } else {
                    found = next_row(r, FS_GNSS_RING, FS_GNSS_ROWS, r->gnss[fs_oldest_slot(r, FS_GNSS_RING)], 10,
                                     now_s, m->pending);
                }
            }
        }
        if (!found) {
            return false;
        }
        if (m->pending[0] > now_s - late_s) {
            return true;
        }
    }
    return false;
}

/* Fuse the next scalar of a sensor whose rows wait. agenda.py:203 */
static int32_t measured(fs_estimator_memory *m, fs_filter *f, fs_rings *r, int32_t source, int32_t axis,
                        const fs_estimator_params *params)
{
    if (axis == 0) {
        if (!take_row(m, f, r, source)) {
            return FS_NOTHING;
        }
    }
    int32_t following = 0;
    if (source == FS_MAG_SOURCE) {
        following = fs_take_field(m, f, m->pending, axis, params);
    } else {
        if (source == FS_BARO_SOURCE) {
            fs_take_baro(m, f, m->pending, params);
        } else {
            if (source == FS_RANGE_SOURCE) {
                fs_take_range(m, f, m->pending, params);
            } else {
                if (axis == FS_YAW_STAGE) {
                    fs_take_velocity(m, f, m->pending);
                } else {
                    following = fs_take_gnss(m, f, m->pending, axis, params);
                }
            }
        }
    }
    return following;
}

/* agenda.py:186 */
int32_t fs_fuse_next(fs_estimator_memory *m, fs_filter *f, fs_rings *r, const fs_estimator_params *params)
{
    const int32_t source = m->agenda.source;
    const int32_t axis = m->agenda.axis;
    if (source == FS_EARTH_SOURCE) {
        return fs_take_earth_field(m, f, axis, params);
    }
    if (source == FS_REST_SOURCE) {
        return rest(m, f, r, axis, params);
    }
    if (source == FS_HOLD_SOURCE) {
        if (axis == 0 && stands(m, params)) {
            return FS_NOTHING;
        }
        return fs_hold_position(m, f, axis, params);
    }
    if (source == FS_DRAG_SOURCE) {
        return drag(m, f, r, axis, params);
    }
    return measured(m, f, r, source, axis, params);
}

/* Move the output by a share of its difference to the filter. agenda.py:179 */
static void move_output(fs_estimator_memory *m, const fs_filter *f, fs_rings *r, fs_real share,
                        const fs_estimator_params *params)
{
    m->followed = fs_count_of_resets(m);
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_motion motion_of = fs_motion_of(&read_nominal);
    fs_follow(r, m->output, &motion_of, share, params->gravity_m_s2);
}

/* Move the output as the filter has moved, and close the step. agenda.py:167 */
static void finish(fs_estimator_memory *m, const fs_filter *f, fs_rings *r, const fs_estimator_params *params)
{
    fs_agenda *agenda = &m->agenda;
    const fs_real dt_s = r->imu[fs_oldest_slot(r, FS_IMU_RING)].dt_s;
    const bool is_reset = fs_count_of_resets(m) != m->followed; /* between two steps, by the Earth's field */
    const fs_real share = is_reset || params->output_s <= dt_s ? FS_LIT(1.0) : dt_s / params->output_s;
    if (is_reset || agenda->has_fused == 1 || share < FS_LIT(1.0)) { /* else the output has moved as the filter has */
        move_output(m, f, r, share, params);
    }
    fs_pop(r, FS_IMU_RING, FS_IMU_ROWS);
    agenda->source = FS_IDLE;
}

/* agenda.py:92 */
bool fs_work(fs_estimator_memory *m, fs_filter *f, fs_rings *r, fs_real horizon_s, const fs_estimator_params *params)
{
    fs_agenda *agenda = &m->agenda;
    if (agenda->source == FS_IDLE) {
        if (!begin(m, f, r, horizon_s, params)) {
            return false;
        }
    }
    for (int32_t count = 0; count < 9; count++) {
        if (agenda->source >= FS_SOURCES) {
            break;
        }
        const int32_t following = fs_fuse_next(m, f, r, params);
        if (following != FS_NOTHING) {
            agenda->axis = following;
            agenda->has_fused = 1;
            if (fs_count_of_resets(m) != m->followed) { /* users of the output follow the count at once */
                move_output(m, f, r, FS_LIT(1.0), params);
            }
            return true;
        }
        agenda->source += 1;
    }
    finish(m, f, r, params);
    return true;
}

/* agenda.py:116 */
void fs_take_field_at_rest(fs_estimator_memory *m, fs_filter *f, fs_rings *r, const fs_estimator_params *params)
{
    for (int32_t count = 0; count < 256; count++) {
        if (m->agenda.source == FS_IDLE) {
            break;
        }
        (void)fs_work(m, f, r, f->clock[0], params);
    }
    const fs_imu_noise noise_of = fs_noise_of(&m->sums);
    fs_predict_errors(f, &noise_of, params);
    int32_t stage = 0;
    for (int32_t count_2 = 0; count_2 < 8; count_2++) {
        stage = fs_take_earth_field(m, f, stage, params);
        if (stage <= 0) {
            break;
        }
    }
}
