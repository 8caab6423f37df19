/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The origin of the filter's clock, which moves: single precision has no milliseconds after some hours.
 * flightstack/estimation/clock_origin.py
 */
#include "fs_clock_origin.h"

#include "fs_math.h"
#include "fs_memory.h"

#define FS_EARLIEST_S FS_LIT(0.001)

/* Return a time, from the new origin; zero stays. clock_origin.py:48 */
static fs_real moved(fs_real time_s, fs_real by_s)
{
    if (time_s == FS_LIT(0.0)) {
        return FS_LIT(0.0);
    }
    return fs_max(time_s - by_s, FS_EARLIEST_S);
}

/* Move the times of the filter and of its fusions. clock_origin.py:88 */
static void move_fusions(fs_estimator_memory *m, fs_filter *f, fs_real by_s)
{
    f->clock[0] = moved(f->clock[0], by_s);
    for (int32_t i = 0; i < 25; i++) {
        f->observations[i].fused_s = moved(f->observations[i].fused_s, by_s);
    }
    m->last_gnss_s = moved(m->last_gnss_s, by_s);
    m->hold.fused_s = moved(m->hold.fused_s, by_s);
    m->rest_s = moved(m->rest_s, by_s);
    m->drag_s = moved(m->drag_s, by_s);
    m->yaw_fix.wrong_s = moved(m->yaw_fix.wrong_s, by_s);
    m->resets.position.time_s = moved(m->resets.position.time_s, by_s);
    m->resets.velocity.time_s = moved(m->resets.velocity.time_s, by_s);
}

/* Move what the checks of the sensors remember. clock_origin.py:72 */
static void move_checks(fs_checks *c, fs_real by_s)
{
    c->accel_until_s = moved(c->accel_until_s, by_s);
    c->baro_until_s = moved(c->baro_until_s, by_s);
    c->equal_since_s = moved(c->equal_since_s, by_s);
    c->gnss_s = moved(c->gnss_s, by_s);
    c->gyro_s = moved(c->gyro_s, by_s);
    c->field_s = moved(c->field_s, by_s);
    c->altitude_s = moved(c->altitude_s, by_s);
    for (int32_t i = 0; i < 2; i++) {
        const fs_real onset_s = c->onset_s[i];
        const fs_real at_s = moved(fs_abs(onset_s), by_s);
        c->onset_s[i] = onset_s < FS_LIT(0.0) ? -at_s : at_s;
    }
}

/* Move the measurements that wait. clock_origin.py:56 */
static void move_rings(fs_rings *r, fs_real by_s)
{
    for (int32_t i = 0; i < 8; i++) {
        r->gnss[i][0] = moved(r->gnss[i][0], by_s);
    }
    for (int32_t i = 0; i < 32; i++) {
        r->mag[i][0] = moved(r->mag[i][0], by_s);
    }
    for (int32_t i = 0; i < 32; i++) {
        r->baro[i][0] = moved(r->baro[i][0], by_s);
    }
    for (int32_t i = 0; i < 32; i++) {
        r->range[i][0] = moved(r->range[i][0], by_s);
    }
    for (int32_t i = 0; i < 64; i++) {
        r->imu[i].time_s = moved(r->imu[i].time_s, by_s);
        r->track[i][0] = moved(r->track[i][0], by_s);
    }
}

/* clock_origin.py:102 */
void fs_move_clock_kernel(fs_estimator_memory *memory, fs_real by_s)
{
    fs_estimator_memory *m = memory;
    m->output[0] = moved(m->output[0], by_s);
    m->pending[0] = moved(m->pending[0], by_s);
    m->last_imu_s = moved(m->last_imu_s, by_s);
    for (int32_t i = 0; i < 5; i++) {
        fs_mean *mean = &m->means[i];
        mean->pushed_s = moved(mean->pushed_s, by_s);
        mean->last_s = moved(mean->last_s, by_s);
        mean->first[0] = moved(mean->first[0], by_s);
    }
    move_fusions(m, &m->filter, by_s);
    move_checks(&m->checks, by_s);
    move_rings(&m->rings, by_s);
}
