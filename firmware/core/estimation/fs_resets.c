/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Resets: a part of the state is set to a measurement, and its change is counted for guidance and position control.
 * flightstack/estimation/resets.py
 */
#include "fs_resets.h"

#include "fs_fusion.h"
#include "fs_kalman.h"
#include "fs_math.h"

#define FS_LEAST_SPEED_M_S FS_LIT(0.3)
#define FS_VELOCITY 3
#define FS_LEAST_POSITION_M FS_LIT(0.5)
#define FS_POSITION 6
#define FS_GNSS_BIAS 24

/* resets.py:74 */
void fs_count_yaw_reset(fs_estimator_memory *m, fs_real turn_rad)
{
    fs_yaw_reset *reset = &m->resets.yaw;
    reset->number += FS_LIT(1.0);
    reset->change_rad = turn_rad;
    reset->sum_rad += turn_rad;
}

/* Count a reset of position or velocity; the changes of one step of the filter are added up. resets.py:58 */
static void count_(fs_reset *reset, fs_real now_s)
{
    reset->number += FS_LIT(1.0);
    if (reset->time_s != now_s) {
        reset->time_s = now_s;
        for (int32_t axis = 0; axis < 3; axis++) {
            reset->change[axis] = FS_LIT(0.0);
        }
    }
}

/* resets.py:68 */
static void add_change(fs_reset *reset, int32_t axis, fs_real change)
{
    reset->change[axis] += change;
    reset->sum[axis] += change;
}

/* resets.py:16 */
void fs_reset_velocity(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t first, int32_t count)
{
    const fs_real speed_m_s = fs_max(fs_speed_accuracy(row), FS_LEAST_SPEED_M_S);
    fs_reset *reset = &m->resets.velocity;
    count_(reset, f->clock[0]);
    for (int32_t axis = first; axis < first + count; axis++) {
        add_change(reset, axis, row[4 + axis] - f->nominal[4 + axis]);
        f->nominal[4 + axis] = row[4 + axis];
        m->refused_s[axis] = FS_LIT(0.0);
    }
    fs_reset_variance(f->covariance, FS_VELOCITY + first, count, speed_m_s * speed_m_s);
}

/* resets.py:28 */
void fs_reset_position(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t first, int32_t count)
{
    fs_real accuracy_m = first == 2 ? fs_vertical_accuracy(row) : fs_horizontal_accuracy(row);
    accuracy_m = fs_max(accuracy_m, FS_LEAST_POSITION_M);
    const fs_real age_s = f->clock[0] - row[0];
    fs_reset *reset = &m->resets.position;
    count_(reset, f->clock[0]);
    for (int32_t axis = first; axis < first + count; axis++) {
        const fs_real now_m = row[1 + axis] + age_s * f->nominal[4 + axis];
        add_change(reset, axis, now_m - f->nominal[7 + axis]);
        f->nominal[7 + axis] = now_m;
        f->nominal[25 + axis] = FS_LIT(0.0);
        m->refused_s[3 + axis] = FS_LIT(0.0);
    }
    fs_reset_variance(f->covariance, FS_POSITION + first, count, accuracy_m * accuracy_m);
    fs_reset_variance(f->covariance, FS_GNSS_BIAS + first, count, FS_LIT(0.0001));
}

/* resets.py:44 */
void fs_count_correction(fs_estimator_memory *m, const fs_filter *f, fs_real north_m, fs_real east_m,
                         fs_real north_m_s, fs_real east_m_s)
{
    fs_reset *position = &m->resets.position;
    fs_reset *velocity = &m->resets.velocity;
    count_(position, f->clock[0]);
    count_(velocity, f->clock[0]);
    add_change(position, 0, north_m);
    add_change(position, 1, east_m);
    add_change(velocity, 0, north_m_s);
    add_change(velocity, 1, east_m_s);
}

/* resets.py:83 */
fs_real fs_count_of_resets(const fs_estimator_memory *m)
{
    const fs_resets *resets = &m->resets;
    const fs_real total = resets->position.number + resets->velocity.number + resets->yaw.number;
    return total;
}
