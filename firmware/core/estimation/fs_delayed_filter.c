/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Entry points of the filter: measurements wait until the delayed horizon reaches them, IMU samples move it.
 * flightstack/estimation/delayed_filter.py
 */
#include "fs_delayed_filter.h"

#include "fs_agenda.h"
#include "fs_alignment.h"
#include "fs_error_state.h"
#include "fs_imu_input.h"
#include "fs_math.h"
#include "fs_memory.h"
#include "fs_output_predictor.h"
#include "fs_prediction.h"
#include "fs_rate_filter.h"
#include "fs_rings.h"

#define FS_MEASURED 7
#define FS_WAIT_S FS_LIT(0.05)
#define FS_GNSS_RING 0
#define FS_GNSS_ROWS 8
#define FS_GNSS_SPARE_ROWS 2
#define FS_MAG_RING 1
#define FS_MAG_ROWS 32
#define FS_BARO_RING 2
#define FS_BARO_ROWS 32
#define FS_RANGE_RING 3
#define FS_RANGE_ROWS 32
#define FS_LONGEST_GAP_S FS_LIT(1.0)
#define FS_IMU_RING 4
#define FS_IMU_ROWS 64
#define FS_BACKLOG_S FS_LIT(0.03)

/* delayed_filter.py:63 */
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
    if (ring == FS_MAG_RING && m->flags.aligned == 0) {
        const fs_vector3 read_vector = fs_read_vector(row, 1);
        fs_add_field(&m->alignment, &read_vector);
    }
    if (!fs_take_mean(&m->means[ring], row, row_size,
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
 * delayed_filter.py:177
 */
static fs_real real_step(fs_estimator_memory *m, fs_real time_s, fs_real dt_s)
{
    const fs_real last_s = m->last_imu_s;
    if (dt_s <= FS_LIT(0.0) || (last_s > FS_LIT(0.0) && time_s <= last_s)) {
        return FS_LIT(0.0);
    }
    m->last_imu_s = time_s;
    const fs_real elapsed_s = time_s - last_s;
    if (last_s == FS_LIT(0.0) || elapsed_s < FS_LIT(1.5) * dt_s) {
        return dt_s;
    }
    m->gaps.number += FS_LIT(1.0);
    m->gaps.total_s += elapsed_s - dt_s;
    const fs_real covered_s = fs_min(elapsed_s, FS_LONGEST_GAP_S);
    fs_note_gap(&m->sums, covered_s - dt_s);
    return covered_s;
}

/* Add a sample to the alignment; align when it is long enough. delayed_filter.py:194 */
static void collect(fs_estimator_memory *m, const fs_vector3 *accel, fs_real time_s, fs_real dt_s,
                    const fs_estimator_params *params)
{
    if (!fs_add_force(&m->alignment, accel, dt_s)) {
        return;
    }
    fs_filter *f = &m->filter;
    const fs_vector3 read_vector = fs_read_vector(m->earth, 0);
    fs_align(f, &m->alignment, &read_vector, m->earth[3], params);
    f->clock[0] = time_s;
    (void)fs_take_step(&m->sums, time_s);
    const fs_nominal read_nominal = fs_read_nominal(f->nominal);
    const fs_motion motion_of = fs_motion_of(&read_nominal);
    fs_write_motion(m->output, time_s, &motion_of);
    m->flags.aligned = 1;
    for (int32_t ring = 1; ring < 4; ring++) {
        m->rings.cursors[ring].rows = 0; /* older than the state; the fields are in its yaw */
    }
    if (m->alignment.fields > FS_LIT(0.0)) {
        m->flags.has_mag = 1;
        m->flags.has_yaw = 1;
        for (int32_t i = 0; i < 3; i++) {
            m->field[i] = m->alignment.field[i] / m->alignment.fields;
        }
    }
}

/*
 * Return True if the filter is so far behind the horizon that a sample does more than a part of its work.
 * delayed_filter.py:147
 */
static bool is_behind(const fs_rings *r, fs_real horizon_s)
{
    const fs_real oldest_s = r->imu[fs_oldest_slot(r, FS_IMU_RING)].time_s;
    return fs_count_of(r, FS_IMU_RING) > 0 && oldest_s < horizon_s - FS_BACKLOG_S;
}

/* Do a part of the filter's work, and all of it while it is behind horizon_s. delayed_filter.py:96 */
static void work_up_to(fs_estimator_memory *m, fs_filter *f, fs_rings *r, fs_real horizon_s,
                       const fs_estimator_params *params)
{
    for (int32_t count = 0; count < 256; count++) {
        const bool has_worked = fs_work(m, f, r, horizon_s, params);
        if (!(has_worked && is_behind(r, horizon_s))) {
            break;
        }
    }
}

/* Write the output in the order of VehicleState. delayed_filter.py:154 */
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

/* delayed_filter.py:105 */
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
    fs_imu_sums *sums = &m->sums;
    const fs_vector3 gyro = fs_read_vector(sample, 2);
    const fs_vector3 accel = fs_read_vector(sample, 5);
    fs_add_sample(sums, &gyro, &accel, dt_s);
    fs_note_clipping(sums, &gyro, &accel, params);
    if (m->flags.aligned == 0) {
        collect(m, &accel, time_s, dt_s, params);
        return;
    }
    const fs_vector3 gyro_bias = fs_read_vector(f->nominal, 10);
    const fs_vector3 scaled = fs_scaled(&gyro, dt_s);
    const fs_vector3 angle = fs_less_bias(&scaled, &gyro_bias, dt_s);
    const fs_vector3 scaled_2 = fs_scaled(&accel, dt_s);
    const fs_vector3 read_vector = fs_read_vector(f->nominal, 13);
    const fs_vector3 delta_velocity = fs_less_bias(&scaled_2, &read_vector, dt_s);
    const fs_vector3 dv = fs_in_start_frame(&angle, &delta_velocity);
    const fs_motion read_motion = fs_read_motion(m->output);
    const fs_motion moved = fs_moved(&read_motion, &angle, &dv, dt_s, params->gravity_m_s2);
    fs_write_motion(m->output, time_s, &moved);
    if (sums->elapsed_s >= params->period_s - FS_LIT(0.25) * dt_s) {
        const fs_delta_sample step = fs_take_step(sums, time_s);
        for (int32_t count = 0; count < 256; count++) {
            if (fs_count_of(r, FS_IMU_RING) < FS_IMU_ROWS) {
                break;
            }
            (void)fs_work(m, f, r, time_s, params); /* move early, so that the filter integrates every step */
        }
        const int32_t slot = fs_push(r, FS_IMU_RING, FS_IMU_ROWS);
        fs_write_step(&r->imu[slot], &step);
        fs_write_row(r->track[slot], 11, m->output);
    }
    /* between two samples, so that rounding does not matter */
    work_up_to(m, f, r, time_s - params->delay_s + FS_LIT(0.25) * dt_s, params);
    const fs_vector3 rates = fs_filtered_rates(&m->rate_filter, &gyro, dt_s, params->gyro_cutoff_hz);
    const fs_vector3 less_bias = fs_less_bias(&rates, &gyro_bias, FS_LIT(1.0));
    write_state(m, &less_bias);
}

/* delayed_filter.py:165 */
void fs_field_kernel(fs_estimator_memory *memory)
{
    fs_estimator_memory *m = memory;
    if (m->flags.aligned == 0) { /* the alignment uses the field as it is */
        return;
    }
    m->flags.field_is_new = 1;
    if (m->flags.landed == 1) {
        const fs_estimator_params *params = &m->params;
        fs_take_field_at_rest(m, &m->filter, &m->rings, params);
    }
}
