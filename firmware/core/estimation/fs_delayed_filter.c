/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Entry points of the filter: measurements wait until the delayed horizon reaches them, IMU samples move it.
 * flightstack/estimation/delayed_filter.py
 */
#include "fs_delayed_filter.h"

#include "fs_alignment.h"
#include "fs_error_state.h"
#include "fs_fusion.h"
#include "fs_geometry.h"
#include "fs_height_sources.h"
#include "fs_imu_input.h"
#include "fs_math.h"
#include "fs_memory.h"
#include "fs_output_predictor.h"
#include "fs_position_sources.h"
#include "fs_prediction.h"
#include "fs_rate_filter.h"
#include "fs_resets.h"
#include "fs_rings.h"
#include "fs_source_checks.h"
#include "fs_yaw_sources.h"

#define FS_MEASURED 7
#define FS_WAIT_S FS_LIT(0.05)
#define FS_GNSS_RING 0
#define FS_GNSS_ROWS 8
#define FS_GNSS_SPARE_ROWS 2
#define FS_MAG_RING 1
#define FS_ALIGNED 0
#define FS_MAG_ROWS 32
#define FS_BARO_RING 2
#define FS_BARO_ROWS 32
#define FS_RANGE_RING 3
#define FS_RANGE_ROWS 32
#define FS_GAPS 2
#define FS_GAP_S 1
#define FS_LONGEST_GAP_S FS_LIT(1.0)
#define FS_GAP_PENDING_S 0
#define FS_ALIGNMENT_S FS_LIT(0.4)
#define FS_WAIT_FOR_MAG_S FS_LIT(2.0)
#define FS_HAS_MAG 5
#define FS_HAS_YAW 6
#define FS_IMU_RING 4
#define FS_IMU_ROWS 64
#define FS_GAP_RATE_RAD_S FS_LIT(0.3)
#define FS_GAP_FORCE_M_S2 FS_LIT(3.0)
#define FS_ATTITUDE 0
#define FS_VELOCITY 3
#define FS_LANDED 1
#define FS_STILL_FORCE_M_S2 FS_LIT(1.0)
#define FS_STILL_RATE_RAD_S FS_LIT(0.08)
#define FS_REST_PERIOD_S FS_LIT(0.1)
#define FS_REST_MEAN_S FS_LIT(0.1)
#define FS_LATE_S FS_LIT(0.3)
#define FS_DRAG_PERIOD_S FS_LIT(0.05)

/* delayed_filter.py:96 */
void fs_push_kernel(fs_estimator_memory *memory, int32_t ring, fs_real row[], int32_t row_size)
{
    for (int32_t i = 0; i < row_size; i++) {
        if (i < FS_MEASURED && !fs_is_finite(row[i])) {
            return;
        }
    }
    fs_estimator_memory *m = memory;
    const fs_estimator_params *params = &m->params;
    fs_rings *r = &m->rings;
    const fs_real wait_s = params->delay_s + FS_WAIT_S;
    int32_t slot;
    if (ring == FS_GNSS_RING) {
        if (row[0] - fs_newest_fix_time(r) >= wait_s / (fs_real)(FS_GNSS_ROWS - FS_GNSS_SPARE_ROWS)) {
            slot = fs_push(r, FS_GNSS_RING, FS_GNSS_ROWS);
            fs_write_row(r->gnss[slot], 10, row);
        }
        return;
    }
    if (ring == FS_MAG_RING && m->flags[FS_ALIGNED] == 0) {
        for (int32_t i = 0; i < 3; i++) {
            m->alignment[3 + i] += row[1 + i];
        }
        m->alignment[7] += FS_LIT(1.0);
    }
    if (!fs_take_mean(m->means[ring], row, row_size,
                      fs_max(params->sensor_period_s, wait_s / (fs_real)(FS_MAG_ROWS - 4)))) {
        return;
    }
    if (ring == FS_MAG_RING) {
        slot = fs_push(r, FS_MAG_RING, FS_MAG_ROWS);
        fs_write_row(r->mag[slot], 4, row);
    } else {
        if (ring == FS_BARO_RING) {
            slot = fs_push(r, FS_BARO_RING, FS_BARO_ROWS);
            fs_write_row(r->baro[slot], 2, row);
        } else {
            slot = fs_push(r, FS_RANGE_RING, FS_RANGE_ROWS);
            fs_write_row(r->range[slot], 2, row);
        }
    }
}

/*
 * Return the time that a sample has to cover: its own, or longer after a gap; zero for one that came too late.
 * delayed_filter.py:192
 */
static fs_real real_step(fs_estimator_memory *m, fs_real time_s, fs_real dt_s)
{
    const fs_real last_s = m->last_imu_s[0];
    if (dt_s <= FS_LIT(0.0) || (last_s > FS_LIT(0.0) && time_s <= last_s)) {
        return FS_LIT(0.0);
    }
    m->last_imu_s[0] = time_s;
    const fs_real elapsed_s = time_s - last_s;
    if (last_s == FS_LIT(0.0) || elapsed_s < FS_LIT(1.5) * dt_s) {
        return dt_s;
    }
    m->imu_gap[FS_GAPS] += FS_LIT(1.0);
    m->imu_gap[FS_GAP_S] += elapsed_s - dt_s;
    m->imu_gap[FS_GAP_PENDING_S] += fs_min(elapsed_s, FS_LONGEST_GAP_S) - dt_s;
    const fs_real covered_s = fs_min(elapsed_s, FS_LONGEST_GAP_S);
    return covered_s;
}

/* Add a sample to the alignment; align when it is long enough. delayed_filter.py:217 */
static void collect(fs_estimator_memory *m, const fs_vector3 *accel, fs_real time_s, fs_real dt_s,
                    const fs_estimator_params *params)
{
    m->alignment[0] += accel->x;
    m->alignment[1] += accel->y;
    m->alignment[2] += accel->z;
    m->alignment[6] += FS_LIT(1.0);
    m->alignment[8] += dt_s;
    if (m->alignment[8] < FS_ALIGNMENT_S || (m->alignment[7] == FS_LIT(0.0) && m->alignment[8] < FS_WAIT_FOR_MAG_S)) {
        return;
    }
    fs_filter *f = &m->filter;
    const fs_vector3 read_vector = fs_read_vector(m->earth, 0);
    fs_align(f, m->alignment, &read_vector, m->earth[3], params);
    f->clock[0] = time_s;
    (void)fs_take_step(m->sums, time_s);
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_motion motion_of = fs_motion_of(&read_nominal);
    fs_write_motion(m->output, time_s, &motion_of);
    m->flags[FS_ALIGNED] = 1;
    for (int32_t ring = 1; ring < 4; ring++) {
        m->rings.cursors[ring][1] = 0; /* older than the state; the fields are in its yaw */
    }
    if (m->alignment[7] > FS_LIT(0.0)) {
        m->flags[FS_HAS_MAG] = 1;
        m->flags[FS_HAS_YAW] = 1;
        for (int32_t i = 0; i < 3; i++) {
            m->field[i] = m->alignment[3 + i] / m->alignment[7];
        }
    }
}

/* delayed_filter.py:209 */
static fs_vector3 in_start_frame(const fs_vector3 *angle, const fs_vector3 *delta_velocity)
{
    const fs_quaternion q = fs_rotation_over(angle, FS_LIT(0.5));
    /* first order: half of the step's angle */
    const fs_real x = FS_LIT(2.0) * q.x;
    const fs_real y = FS_LIT(2.0) * q.y;
    const fs_real z = FS_LIT(2.0) * q.z;
    const fs_vector3 *v = delta_velocity;
    return (fs_vector3){
        .x = v->x + y * v->z - z * v->y,
        .y = v->y + z * v->x - x * v->z,
        .z = v->z + x * v->y - y * v->x,
    };
}

/* Add the uncertainty of time without samples. delayed_filter.py:278 */
static void account_for_gap(fs_estimator_memory *m, fs_filter *f)
{
    const fs_real gap_s = m->imu_gap[FS_GAP_PENDING_S];
    if (gap_s > FS_LIT(0.0)) {
        const fs_real angle_rad = FS_GAP_RATE_RAD_S * gap_s;
        const fs_real speed_m_s = FS_GAP_FORCE_M_S2 * gap_s;
        for (int32_t axis = 0; axis < 3; axis++) {
            f->covariance[FS_ATTITUDE + axis][FS_ATTITUDE + axis] += angle_rad * angle_rad;
            f->covariance[FS_VELOCITY + axis][FS_VELOCITY + axis] += speed_m_s * speed_m_s;
        }
        m->imu_gap[FS_GAP_PENDING_S] = FS_LIT(0.0);
    }
}

/* delayed_filter.py:290 */
static bool stands(const fs_estimator_memory *m, const fs_estimator_params *params)
{
    const fs_vector3 rate = fs_mean_rate(m->sums);
    const fs_vector3 force = fs_mean_force(m->sums);
    const fs_vector3 bias = fs_read_vector(m->filter.nominal, 10);
    const fs_real off = fs_sqrt(force.x * force.x + force.y * force.y + force.z * force.z) - params->gravity_m_s2;
    const fs_real largest = fs_max(fs_max(fs_abs(rate.x - bias.x), fs_abs(rate.y - bias.y)), fs_abs(rate.z - bias.z));
    return fs_abs(off) < FS_STILL_FORCE_M_S2 && largest < FS_STILL_RATE_RAD_S;
}

/* Fuse rest ten times a second; return True if it was. delayed_filter.py:299 */
static bool rest(fs_estimator_memory *m, fs_filter *f, const fs_delta_sample *step, const fs_estimator_params *params)
{
    if (f->clock[0] - m->rest_s[0] < FS_REST_PERIOD_S) {
        return false;
    }
    m->rest_s[0] = f->clock[0];
    if (fs_is_platform_at_rest(m, f)) {
        fs_fuse_rest_velocity(f, params);
    }
    const fs_real density = fs_max(fs_max(step->gyro_density.x, step->gyro_density.y), step->gyro_density.z);
    const fs_vector3 mean_rate = fs_mean_rate(m->sums);
    fs_fuse_rest_rate(f, &mean_rate, density / FS_REST_MEAN_S, params);
    return true;
}

/*
 * Fuse rest of a vehicle that stands, or the held position without GNSS; return True if it was. delayed_filter.py:270
 */
static bool bound(fs_estimator_memory *m, fs_filter *f, const fs_delta_sample *step,
                  const fs_estimator_params *params)
{
    if (m->flags[FS_LANDED] == 1 && stands(m, params)) {
        return rest(m, f, step, params);
    }
    return fs_hold_position(m, f, params);
}

/*
 * Fuse all measurements that are due; drop those that are too late. Return False if none was due.
 * delayed_filter.py:323
 */
static bool fuse_waiting(fs_estimator_memory *m, fs_filter *f, fs_rings *r, const fs_estimator_params *params)
{
    const fs_real now_s = f->clock[0];
    const int32_t waiting = fs_count_of_measurements(r);
    for (int32_t count = 0; count < 32; count++) {
        fs_real *field = r->mag[fs_slot_of(r, FS_MAG_RING, FS_MAG_ROWS, 0)];
        if (!fs_is_due(r, FS_MAG_RING, field[0], now_s)) {
            break;
        }
        if (field[0] > now_s - FS_LATE_S) {
            fs_take_field(m, f, field, params);
        }
        fs_pop(r, FS_MAG_RING, FS_MAG_ROWS);
    }
    for (int32_t count_2 = 0; count_2 < 32; count_2++) {
        fs_real *altitude = r->baro[fs_slot_of(r, FS_BARO_RING, FS_BARO_ROWS, 0)];
        if (!fs_is_due(r, FS_BARO_RING, altitude[0], now_s)) {
            break;
        }
        if (altitude[0] > now_s - FS_LATE_S) {
            fs_take_baro(m, f, altitude, params);
        }
        fs_pop(r, FS_BARO_RING, FS_BARO_ROWS);
    }
    for (int32_t count_3 = 0; count_3 < 32; count_3++) {
        fs_real *distance = r->range[fs_slot_of(r, FS_RANGE_RING, FS_RANGE_ROWS, 0)];
        if (!fs_is_due(r, FS_RANGE_RING, distance[0], now_s)) {
            break;
        }
        if (distance[0] > now_s - FS_LATE_S) {
            fs_take_range(m, f, distance, params);
        }
        fs_pop(r, FS_RANGE_RING, FS_RANGE_ROWS);
    }
    for (int32_t count_4 = 0; count_4 < 8; count_4++) {
        fs_real *fix = r->gnss[fs_slot_of(r, FS_GNSS_RING, FS_GNSS_ROWS, 0)];
        if (!fs_is_due(r, FS_GNSS_RING, fix[0], now_s)) {
            break;
        }
        if (fix[0] > now_s - FS_LATE_S) {
            fs_take_gnss(m, f, fix, params);
            fs_take_velocity(m, f, fix);
        }
        fs_pop(r, FS_GNSS_RING, FS_GNSS_ROWS);
    }
    return fs_count_of_measurements(r) != waiting;
}

/*
 * Fuse drag in flight while the velocity over ground is measured, twenty times a second; return True if it was.
 * delayed_filter.py:312
 */
static bool drag(fs_estimator_memory *m, fs_filter *f, const fs_delta_sample *step, const fs_estimator_params *params)
{
    const bool is_due = f->clock[0] - m->drag_s[0] >= FS_DRAG_PERIOD_S;
    if (params->drag_is_fused == FS_LIT(0.0) || m->flags[FS_LANDED] == 1 || !is_due || !fs_is_velocity_measured(f)) {
        return false;
    }
    m->drag_s[0] = f->clock[0];
    const fs_vector3 scaled = fs_scaled(&step->velocity_m_s, FS_LIT(1.0) / step->dt_s);
    fs_fuse_drag(f, &scaled, params);
    return true;
}

/* Move the filter by one step if it is older than the horizon; return True if it moved. delayed_filter.py:242 */
static bool advance(fs_estimator_memory *m, fs_filter *f, fs_rings *r, fs_real horizon_s,
                    const fs_estimator_params *params)
{
    if (r->cursors[FS_IMU_RING][1] == 0) {
        return false;
    }
    const int32_t slot = fs_slot_of(r, FS_IMU_RING, FS_IMU_ROWS, 0);
    if (r->imu[slot][0] > horizon_s) {
        return false;
    }
    const fs_delta_sample step = fs_read_step(r->imu[slot]);
    fs_predict_yaw(m, f, &step);
    fs_predict(f, &step, params);
    account_for_gap(m, f);
    fs_add_fault_noise(m->checks, f, step.dt_s);
    bool has_changed = bound(m, f, &step, params);
    bool is_fused = fuse_waiting(m, f, r, params);
    if (!is_fused) {
        is_fused = drag(m, f, &step, params);
    }
    has_changed = has_changed || is_fused;
    fs_real share = params->output_s <= step.dt_s ? FS_LIT(1.0) : step.dt_s / params->output_s;
    if (fs_count_of_resets(m) != m->followed[0]) { /* also one between two steps, by the Earth's field */
        share = FS_LIT(1.0);
        m->followed[0] = fs_count_of_resets(m);
        has_changed = true;
    }
    if (has_changed || share < FS_LIT(1.0)) { /* else the output has moved as the filter has */
        const fs_nominal read_nominal = fs_read_nominal(f->nominal);
        const fs_motion motion_of = fs_motion_of(&read_nominal);
        fs_follow(r, m->output, &motion_of, share, params->gravity_m_s2);
    }
    fs_pop(r, FS_IMU_RING, FS_IMU_ROWS);
    return true;
}

/* Write the output in the order of VehicleState. delayed_filter.py:173 */
static void write_state(fs_estimator_memory *m, const fs_vector3 *rates)
{
    for (int32_t i = 0; i < 3; i++) {
        const fs_real value = m->output[8 + i];
        const fs_real value_2 = m->output[5 + i];
        m->state[i] = value;
        m->state[3 + i] = value_2;
    }
    for (int32_t i = 0; i < 4; i++) {
        m->state[6 + i] = m->output[1 + i];
    }
    fs_write_vector(m->state, 10, rates);
}

/* delayed_filter.py:131 */
void fs_imu_kernel(fs_estimator_memory *memory, const fs_real sample[])
{
    for (int32_t i = 0; i < 8; i++) {
        if (!fs_is_finite(sample[i])) {
            return;
        }
    }
    fs_estimator_memory *m = memory;
    const fs_real time_s = sample[0];
    const fs_real dt_s = real_step(m, sample[0], sample[1]);
    if (dt_s <= FS_LIT(0.0)) {
        return;
    }
    const fs_estimator_params *params = &m->params;
    fs_filter *f = &m->filter;
    fs_rings *r = &m->rings;
    const fs_vector3 gyro = fs_read_vector(sample, 2);
    const fs_vector3 accel = fs_read_vector(sample, 5);
    fs_add_sample(m->sums, &gyro, &accel, dt_s);
    if (m->flags[FS_ALIGNED] == 0) {
        collect(m, &accel, time_s, dt_s, params);
        return;
    }
    const fs_nominal n = fs_read_nominal(f->nominal);
    const fs_vector3 scaled = fs_scaled(&gyro, dt_s);
    const fs_vector3 angle = fs_less_bias(&scaled, &n.gyro_bias_rad_s, dt_s);
    const fs_vector3 scaled_2 = fs_scaled(&accel, dt_s);
    const fs_vector3 delta_velocity = fs_less_bias(&scaled_2, &n.accel_bias_m_s2, dt_s);
    const fs_motion start = fs_read_motion(m->output);
    /* the mean specific force acts in the attitude in the middle of the sample */
    const fs_vector3 dv = in_start_frame(&angle, &delta_velocity);
    const fs_motion moved = fs_moved(&start, &angle, &dv, dt_s, params->gravity_m_s2);
    fs_write_motion(m->output, time_s, &moved);
    if (m->sums[0] >= params->period_s - FS_LIT(0.25) * dt_s) {
        const fs_delta_sample step = fs_take_step(m->sums, time_s);
        if (r->cursors[FS_IMU_RING][1] >= FS_IMU_ROWS) { /* move early, so that the filter integrates every step */
            (void)advance(m, f, r, time_s, params);
        }
        const int32_t slot = fs_push(r, FS_IMU_RING, FS_IMU_ROWS);
        fs_write_step(r->imu[slot], &step);
        fs_write_row(r->track[slot], 11, m->output);
        for (int32_t count = 0; count < 4; count++) {
            if (!advance(m, f, r, time_s - params->delay_s, params)) {
                break;
            }
        }
    }
    const fs_vector3 rates = fs_filtered_rates(m->rate_filter, &gyro, dt_s, params->gyro_cutoff_hz);
    const fs_vector3 less_bias = fs_less_bias(&rates, &n.gyro_bias_rad_s, FS_LIT(1.0));
    write_state(m, &less_bias);
}

/* delayed_filter.py:184 */
void fs_field_kernel(fs_estimator_memory *memory)
{
    fs_estimator_memory *m = memory;
    if (m->flags[FS_ALIGNED] == 1) {
        fs_take_earth_field(m, &m->filter, &m->params);
    }
}
