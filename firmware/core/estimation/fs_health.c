/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Health of an estimate: what commander and arming checks need to know of it. flightstack/estimation/health.py */
#include "fs_health.h"

#include "fs_math.h"

#define FS_GNSS_POSITION 3
#define FS_GNSS_VELOCITY 0
#define FS_POSITION 6
#define FS_VELOCITY 3
#define FS_ATTITUDE 0
#define FS_GYRO_BIAS 9
#define FS_ACCEL_BIAS 12
#define FS_SMOOTHING FS_LIT(0.1)
#define FS_MOST_MEAN FS_LIT(2.0)
#define FS_SCATTERED FS_LIT(0.5)
#define FS_BARO 6
#define FS_MAG 7

/* health.py:108 */
static fs_real largest(const fs_real values[], int32_t first, int32_t count)
{
    fs_real largest_ = FS_LIT(0.0);
    for (int32_t i = first; i < first + count; i++) {
        largest_ = fs_max(largest_, fs_abs(values[i]));
    }
    return largest_;
}

/*
 * Update the mean ratio of innovations to their gate, with their signs, and that of the squares.
 *
 * The mean of noise is zero, that of an error of the estimate is not: +- 0.08 at a gate of three deviations and a
 * measurement an interval. The largest magnitude of three axes is 0.44 in the mean without any error, hardly below
 * the limit. Errors that alternate cancel in the mean, and are found by the mean square.
 *
 * health.py:116
 */
static void follow_ratio(fs_health_summary *s, int32_t row, const fs_observed *o)
{
    const fs_real sign = o->innovation < FS_LIT(0.0) ? FS_LIT(-1.0) : FS_LIT(1.0);
    fs_real mean = s->mean_ratios[row];
    fs_real square = s->mean_squares[row];
    mean += FS_SMOOTHING * (sign * fs_sqrt(o->test_ratio) - mean);
    square += FS_SMOOTHING * (o->test_ratio - square);
    if (!(square <= FS_MOST_MEAN * FS_MOST_MEAN)) { /* also if the ratio is NaN */
        square = FS_MOST_MEAN * FS_MOST_MEAN;
    }
    if (!(fs_abs(mean) <= FS_MOST_MEAN)) {
        mean = sign * FS_MOST_MEAN;
    }
    s->mean_ratios[row] = mean;
    s->mean_squares[row] = square;
}

/* Return the largest mean ratio of count rows, or the root of the mean square if they scatter. health.py:135 */
static fs_real ratio(const fs_health_summary *s, int32_t first, int32_t count)
{
    const fs_real square = largest(s->mean_squares, first, count);
    return square > FS_SCATTERED ? fs_sqrt(square) : largest(s->mean_ratios, first, count);
}

/* Write the summary of an estimator's record; it holds the mean ratios of the last call. health.py:142 */
static void summarise(const fs_estimator_memory *m, fs_health_summary *s)
{
    const fs_real position_s = fs_min(m->filter.observations[FS_GNSS_POSITION].fused_s,
                                      m->filter.observations[FS_GNSS_POSITION + 1].fused_s);
    const fs_real velocity_s = fs_min(m->filter.observations[FS_GNSS_VELOCITY].fused_s,
                                      m->filter.observations[FS_GNSS_VELOCITY + 1].fused_s);
    s->unaided_s = m->filter.clock[0] - fs_max(position_s, velocity_s);
    s->refused_s = fs_max(fs_max(m->refused_s[3], m->refused_s[4]), m->refused_s[5]);
    s->lag_s = m->output[0] - m->filter.clock[0];
    s->horizontal_m = fs_sqrt(m->filter.covariance[FS_POSITION][FS_POSITION] +
                              m->filter.covariance[FS_POSITION + 1][FS_POSITION + 1]);
    s->velocity_m_s = fs_sqrt(m->filter.covariance[FS_VELOCITY][FS_VELOCITY] +
                              m->filter.covariance[FS_VELOCITY + 1][FS_VELOCITY + 1]);
    s->tilt_rad = fs_sqrt(fs_max(m->filter.covariance[FS_ATTITUDE][FS_ATTITUDE],
                                 m->filter.covariance[FS_ATTITUDE + 1][FS_ATTITUDE + 1]));
    s->gyro_bias_rad_s = largest(m->filter.nominal, FS_GYRO_BIAS + 1, 3);
    s->accel_bias_m_s2 = largest(m->filter.nominal, FS_ACCEL_BIAS + 1, 3);
    for (int32_t row = 0; row < 10; row++) {
        follow_ratio(s, row, &m->filter.observations[row]);
    }
    s->velocity_ratio = ratio(s, FS_GNSS_VELOCITY, 3);
    s->position_ratio = ratio(s, FS_GNSS_POSITION, 2);
    s->height_ratio = ratio(s, FS_BARO, 1);
    s->heading_ratio = ratio(s, FS_MAG, 3);
}

/* health.py:161 */
void fs_health_kernel(const fs_estimator_memory *memory, fs_health_summary *summary)
{
    summarise(memory, summary);
}
