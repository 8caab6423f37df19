/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Yaw: the magnetometer with the Earth's field, and GNSS velocity through the bank of yaw models.
 * flightstack/estimation/yaw_sources.py
 */
#include "fs_yaw_sources.h"

#include "fs_alignment.h"
#include "fs_error_state.h"
#include "fs_estimation_geometry.h"
#include "fs_estimation_math.h"
#include "fs_fusion.h"
#include "fs_geometry.h"
#include "fs_imu_input.h"
#include "fs_kalman.h"
#include "fs_math.h"
#include "fs_prediction.h"
#include "fs_resets.h"
#include "fs_source_checks.h"
#include "fs_yaw_estimator.h"

#define FS_NOTHING -1
#define FS_LARGEST_TURN_RAD FS_LIT(0.5)
#define FS_FIELD_STAGE 4
#define FS_EARTH_FIELD 15
#define FS_DECLINATION_NOISE_RAD FS_LIT(0.01)
#define FS_WHITE FS_LIT(0.0)
#define FS_DECLINATION 22
#define FS_KNOWN_FIELD 19
#define FS_COUNTED_TURN_RAD FS_LIT(0.01)
#define FS_CONVERGED_RAD FS_LIT(0.262)
#define FS_ATTITUDE 0
#define FS_WRONG_YAW_RAD FS_LIT(0.436)
#define FS_CERTAIN_SQUARE FS_LIT(16.0)
#define FS_REFUSED_S FS_LIT(1.0)

/* yaw_sources.py:182 */
void fs_predict_yaw(fs_estimator_memory *m, const fs_filter *f, const fs_delta_sample *step)
{
    if (m->yaw_fix.updates > FS_LIT(0.0)) {
        const fs_vector3 read_vector = fs_read_vector(f->nominal, 10);
        const fs_vector3 angle = fs_less_bias(&step->angle_rad, &read_vector, step->dt_s);
        const fs_vector3 read_vector_2 = fs_read_vector(f->nominal, 13);
        const fs_vector3 velocity = fs_less_bias(&step->velocity_m_s, &read_vector_2, step->dt_s);
        fs_predict_models(&m->yaw_bank, &angle, &velocity, step->dt_s);
    }
}

/*
 * Turn the Earth's field by a change of the declination; the yaw follows as far as it depends on it.
 * yaw_sources.py:164
 */
static void fuse_declination(fs_filter *f, fs_real was_rad, fs_real change_rad)
{
    const fs_real north = f->nominal[16];
    const fs_real east = f->nominal[17];
    const fs_real square = north * north + east * east;
    fs_clear(f->h);
    f->h[FS_EARTH_FIELD] = -east / square;
    f->h[FS_EARTH_FIELD + 1] = north / square;
    const fs_noise noise = {
        .least = FS_DECLINATION_NOISE_RAD,
        .start = FS_DECLINATION_NOISE_RAD,
        .largest = FS_DECLINATION_NOISE_RAD,
        .gate = FS_LIT(1000.0),
        .kind = FS_WHITE,
    };
    (void)fs_fuse(f, FS_DECLINATION, change_rad, &noise, FS_LIT(0.0));
    fs_real sine;
    fs_real cosine;
    fs_sin_cos(was_rad + change_rad, &sine, &cosine);
    const fs_real along = north * cosine + east * sine;
    const fs_real across = f->nominal[17] * cosine - f->nominal[16] * sine;
    /* the linear update would lengthen the field */
    f->nominal[16] = along * cosine - across * sine;
    f->nominal[17] = along * sine + across * cosine;
}

/* Align the yaw again, or fuse the declination; return the next stage. yaw_sources.py:136 */
static int32_t begin_earth_field(fs_estimator_memory *m, fs_filter *f, const fs_estimator_params *params)
{
    const fs_vector3 known = fs_read_vector(m->earth, 0);
    const fs_nominal before = fs_read_nominal(f->nominal);
    const fs_quaternion *q = &before.attitude;
    const fs_vector3 *held = &before.earth_field_ned_gauss;
    m->pending[0] = q->w;
    m->pending[1] = q->x;
    m->pending[2] = q->y;
    m->pending[3] = q->z;
    const fs_real was_rad = fs_atan2(held->y, held->x);
    const fs_real change_rad = fs_wrap_pi(fs_atan2(known.y, known.x) - was_rad);
    if (m->flags.landed == 1 || fs_abs(change_rad) > FS_LARGEST_TURN_RAD) {
        const fs_vector3 read_vector = fs_read_vector(m->field, 0);
        (void)fs_turn_to_field(f, &read_vector, &known, m->earth[3], params);
        return FS_FIELD_STAGE;
    }
    fuse_declination(f, was_rad, change_rad);
    return 1;
}

/* Fuse a component of the Earth's field. yaw_sources.py:125 */
static void fuse_known_field(const fs_estimator_memory *m, fs_filter *f, int32_t axis,
                             const fs_estimator_params *params)
{
    const fs_real value = m->earth[axis];
    const fs_real noise = params->earth_field_gauss + params->field_scale * fs_abs(value);
    fs_clear(f->h);
    f->h[FS_EARTH_FIELD + axis] = FS_LIT(1.0);
    const fs_noise of_model = {noise, noise, noise, FS_LIT(1000.0), FS_WHITE};
    (void)fs_fuse(f, FS_KNOWN_FIELD + axis, value - f->nominal[16 + axis], &of_model, FS_LIT(0.0));
}

/*
 * Count the turn since the attitude in pending as a reset of the yaw; the field is not new any more.
 * yaw_sources.py:152
 */
static void count_turn(fs_estimator_memory *m, const fs_filter *f)
{
    m->flags.field_is_new = 0;
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_quaternion before_2 = {
        .w = m->pending[0],
        .x = m->pending[1],
        .y = m->pending[2],
        .z = m->pending[3],
    };
    const fs_real turn_rad = fs_turn_between(&before_2, &read_nominal.attitude);
    if (fs_abs(turn_rad) > FS_COUNTED_TURN_RAD) {
        fs_count_yaw_reset(m, turn_rad);
    }
}

/* yaw_sources.py:99 */
int32_t fs_take_earth_field(fs_estimator_memory *m, fs_filter *f, int32_t stage, const fs_estimator_params *params)
{
    fs_flags *flags = &m->flags;
    if (stage == 0) {
        if (flags->field_is_new == 0) {
            return FS_NOTHING;
        }
        if (flags->has_mag == 0 || flags->mag_fault == 1) {
            flags->field_is_new = 0;
            return FS_NOTHING;
        }
        return begin_earth_field(m, f, params);
    }
    if (stage >= FS_FIELD_STAGE) {
        const fs_vector3 field = fs_read_vector(m->field, 0);
        fs_fuse_field_axis(f, fs_axis_by_yaw(&field, stage - FS_FIELD_STAGE), &field, params);
    } else {
        fuse_known_field(m, f, stage - 1, params);
    }
    if (stage == FS_FIELD_STAGE - 1 || stage == FS_FIELD_STAGE + 2) {
        count_turn(m, f);
        return 0;
    }
    return stage + 1;
}

/* Note the field; set the states of the field, and an unknown yaw, by the first one. yaw_sources.py:83 */
static void start_field(fs_estimator_memory *m, fs_filter *f, const fs_vector3 *field,
                        const fs_estimator_params *params)
{
    m->field[0] = field->x;
    m->field[1] = field->y;
    m->field[2] = field->z;
    if (m->flags.has_mag == 0) {
        m->flags.has_mag = 1;
        if (m->flags.has_yaw == 0) {
            const fs_vector3 read_vector = fs_read_vector(m->earth, 0);
            const fs_real turn_rad = fs_align_yaw(f, field, &read_vector, m->earth[3], params);
            fs_count_yaw_reset(m, turn_rad);
            m->flags.has_yaw = 1;
        } else {
            const fs_nominal read_nominal = fs_read_nominal(f->nominal);
            const fs_vector3 level = fs_rotate(&read_nominal.attitude, field);
            const fs_vector3 read_vector_2 = fs_read_vector(m->earth, 0);
            fs_set_field(f, &level, &read_vector_2, m->earth[3], params);
        }
    }
}

/* yaw_sources.py:65 */
int32_t fs_take_field(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t axis,
                      const fs_estimator_params *params)
{
    const fs_vector3 field = fs_read_vector(row, 1);
    if (m->flags.mag_fault == 1) {
        return 0;
    }
    if (axis == 0) {
        start_field(m, f, &field, params);
    }
    fs_fuse_field_axis(f, axis, &field, params);
    if (axis == 2 && m->flags.landed == 0) {
        const fs_vector3 mean_rate = fs_mean_rate(&m->sums);
        const fs_real rate_rad_s = mean_rate.z - f->nominal[12];
        fs_take_field_innovations(&m->checks, f, rate_rad_s, params->gravity_m_s2);
    }
    return axis < 2 ? axis + 1 : 0;
}

/* Take tilt and yaw from the models, velocity and position from GNSS. yaw_sources.py:229 */
static void reset_to_models(fs_estimator_memory *m, fs_filter *f, const fs_real row[])
{
    m->yaw_fix.wrong_s = FS_LIT(0.0);
    fs_yaw_bank *bank = &m->yaw_bank;
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_quaternion before = read_nominal.attitude;
    fs_yaw_model *best = &bank->models[fs_likeliest(bank)];
    fs_quaternion q = fs_attitude_of(best);
    const fs_vector3 world_rotation = {
        .x = FS_LIT(0.0),
        .y = FS_LIT(0.0),
        .z = m->yaw_fix.turn_rad - fs_turn_between(&before, &q),
    };
    q = fs_turned(&q, &world_rotation);
    f->nominal[0] = q.w;
    f->nominal[1] = q.x;
    f->nominal[2] = q.y;
    f->nominal[3] = q.z;
    for (int32_t axis = 0; axis < 2; axis++) {
        fs_reset_variance(f->covariance, FS_ATTITUDE + axis, 1, fs_tilt_variance(best, axis));
    }
    fs_reset_variance(f->covariance, FS_ATTITUDE + 2, 1, m->yaw_fix.variance);
    fs_count_yaw_reset(m, fs_turn_between(&before, &q));
    m->flags.has_yaw = 1;
    fs_reset_velocity(m, f, row, 0, 2);
    fs_reset_position(m, f, row, 0, 2);
}

/*
 * Return True if the models have contradicted the yaw for a second, or do while GNSS velocities are refused.
 * yaw_sources.py:215
 */
static bool is_wrong(fs_estimator_memory *m, fs_real time_s)
{
    fs_yaw_fix *fix = &m->yaw_fix;
    const bool differs = fs_abs(fix->turn_rad) > FS_WRONG_YAW_RAD;
    if (!(differs && fix->turn_rad * fix->turn_rad > FS_CERTAIN_SQUARE * fix->variance)) {
        fix->wrong_s = FS_LIT(0.0);
    } else {
        if (fix->wrong_s == FS_LIT(0.0)) {
            fix->wrong_s = time_s;
        }
    }
    const bool lasts = fix->wrong_s > FS_LIT(0.0) && time_s - fix->wrong_s > FS_REFUSED_S;
    const bool is_refused = fs_max(m->refused_s[0], m->refused_s[1]) > FS_REFUSED_S;
    return lasts || (differs && is_refused);
}

/* yaw_sources.py:191 */
void fs_take_velocity(fs_estimator_memory *m, fs_filter *f, const fs_real row[])
{
    fs_yaw_bank *bank = &m->yaw_bank;
    fs_yaw_fix *fix = &m->yaw_fix;
    fs_flags *flags = &m->flags;
    if (flags->landed == 1 || flags->has_gnss == 0) {
        fix->updates = FS_LIT(0.0);
        return;
    }
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_quaternion attitude = read_nominal.attitude;
    const fs_real noise_m_s = fs_max(fs_speed_accuracy(row), FS_LIT(0.1));
    if (fix->updates == FS_LIT(0.0)) {
        fs_start_models(bank, &attitude, row[4], row[5], noise_m_s * noise_m_s);
    } else {
        fs_update_models(bank, row[4], row[5], noise_m_s * noise_m_s);
    }
    fix->updates += FS_LIT(1.0);
    fix->turn_rad = fs_mean_turn(bank, &attitude);
    fix->variance = fs_variance_of(bank, &attitude, fix->turn_rad);
    if (fix->variance > FS_CONVERGED_RAD * FS_CONVERGED_RAD) {
        return;
    }
    if (flags->has_yaw == 0) {
        reset_to_models(m, f, row);
    } else {
        if (is_wrong(m, row[0])) {
            flags->mag_fault = flags->has_mag;
            reset_to_models(m, f, row);
        }
    }
}
