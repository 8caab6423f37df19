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
#define FS_BARO 6
#define FS_MAG 7

/* health.py:104 */
static fs_real largest(const fs_real values[], int32_t first, int32_t count)
{
    fs_real largest_ = FS_LIT(0.0);
    for (int32_t i = first; i < first + count; i++) {
        largest_ = fs_max(largest_, fs_abs(values[i]));
    }
    return largest_;
}

/*
 * Return the mean of the ratios of innovations to their gates after the newest one.
 *
 * Ratios have the sign of the innovation: the mean of noise is zero, +- 0.08 at a gate of three deviations, that of
 * an error of the estimate is not. The mean of the magnitudes is 0.4 at this gate without any error, hardly below the
 * limit.
 *
 * health.py:112
 */
static fs_real follow_ratio(fs_real mean, const fs_observed *o)
{
    const fs_real sign = o->innovation < FS_LIT(0.0) ? FS_LIT(-1.0) : FS_LIT(1.0);
    const fs_real new_mean = mean + FS_SMOOTHING * (sign * fs_sqrt(o->test_ratio) - mean);
    if (!(fs_abs(new_mean) <= FS_MOST_MEAN)) { /* also if the ratio is NaN */
        return sign * FS_MOST_MEAN;
    }
    return new_mean;
}

/* Write the summary of an estimator's record; it holds the mean ratios of the last call. health.py:127 */
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
        s->mean_ratios[row] = follow_ratio(s->mean_ratios[row], &m->filter.observations[row]);
    }
    s->velocity_ratio = largest(s->mean_ratios, FS_GNSS_VELOCITY, 3);
    s->position_ratio = largest(s->mean_ratios, FS_GNSS_POSITION, 2);
    s->height_ratio = largest(s->mean_ratios, FS_BARO, 1);
    s->heading_ratio = largest(s->mean_ratios, FS_MAG, 3);
}

/* health.py:149 */
void fs_health_kernel(const fs_estimator_memory *memory, fs_health_summary *summary)
{
    summarise(memory, summary);
}
