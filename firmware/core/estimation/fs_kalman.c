/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Scalar measurement updates of the error-state Kalman filter, with gates and adaptive measurement noise.
 * flightstack/estimation/kalman.py
 */
#include "fs_kalman.h"

#include "fs_error_state.h"
#include "fs_math.h"

#define FS_WHITE FS_LIT(0.0)
#define FS_LARGEST_CORRELATION FS_LIT(0.95)
#define FS_SLOW FS_LIT(2.0)
#define FS_ADAPTATION FS_LIT(0.01)
#define FS_PRIOR FS_LIT(2.0)
#define FS_HOLDS_HORIZONTAL FS_LIT(2.0)
#define FS_HOLDS_TILT_AND_GYRO FS_LIT(3.0)

/* kalman.py:236 */
void fs_reset_variance(fs_real p[27][27], int32_t at, int32_t count, fs_real variance)
{
    for (int32_t i = at; i < at + count; i++) {
        for (int32_t j = 0; j < i; j++) {
            p[j][i] = FS_LIT(0.0);
        }
        for (int32_t j = i; j < 27; j++) {
            p[i][j] = FS_LIT(0.0);
        }
        p[i][i] = variance;
    }
}

/* kalman.py:104 */
void fs_clear(fs_real x[27])
{
    for (int32_t i = 0; i < 27; i++) {
        x[i] = FS_LIT(0.0);
    }
}

/* Write P h' to ph and return h P h'. kalman.py:117 */
static fs_real project(fs_filter *f)
{
    fs_clear(f->ph);
    fs_real total = FS_LIT(0.0);
    for (int32_t k = 0; k < 27; k++) {
        const fs_real slope = f->h[k];
        if (slope != FS_LIT(0.0)) {
            total += slope * (FS_LIT(2.0) * f->ph[k] + slope * f->covariance[k][k]);
            for (int32_t i = 0; i < k; i++) {
                f->ph[i] += slope * f->covariance[i][k];
            }
            for (int32_t i = k; i < 27; i++) {
                f->ph[i] += slope * f->covariance[k][i];
            }
        }
    }
    return total;
}

/* kalman.py:191 */
fs_real fs_correlation_factor(const fs_observed *o)
{
    const fs_real correlation = fs_min(fs_max(o->lagged / o->variance, FS_LIT(0.0)), FS_LARGEST_CORRELATION);
    const fs_real factor = (FS_LIT(1.0) + correlation) / (FS_LIT(1.0) - correlation);
    return factor;
}

/*
 * Move the noise variance r towards that of the accepted innovation; the first ones count for more.
 *
 * Each of these has twice its share of a mean: the noise stated at the start is forgotten with their number's square.
 * Half the squared difference of two successive innovations has the variance of white noise, and an error of the
 * model, which both have, does not count. Correlated errors have the whole variance, as their correlation is counted
 * apart.
 *
 * kalman.py:154
 */
static void adapt_noise(fs_observed *o, fs_real r, fs_real projected, fs_real last, const fs_noise *noise)
{
    const fs_real innovation = o->innovation;
    o->lagged += FS_ADAPTATION * (innovation * last - o->lagged);
    fs_real share = FS_ADAPTATION;
    fs_real square = innovation * innovation;
    if (noise->kind != FS_SLOW && o->fused > FS_LIT(1.0)) {
        share = fs_max(share, FS_LIT(2.0) / (o->fused + FS_PRIOR));
        if (noise->kind == FS_WHITE) {
            square = FS_LIT(0.5) * (innovation - last) * (innovation - last);
        }
    }
    const fs_real estimate = square - projected;
    const fs_real least = noise->least * noise->least;
    const fs_real largest = noise->largest * noise->largest;
    o->noise = fs_min(fs_max(r + share * (estimate - r), least), largest);
}

/* Make the gains of the states that are held zero. kalman.py:175 */
static void hold(fs_real gain[27], fs_real holds)
{
    if (holds == FS_HOLDS_HORIZONTAL) {
        for (int32_t i = 0; i < 2; i++) {
            gain[3 + i] = FS_LIT(0.0);
            gain[6 + i] = FS_LIT(0.0);
        }
    } else {
        if (holds > FS_LIT(0.0)) {
            gain[0] = FS_LIT(0.0);
            gain[1] = FS_LIT(0.0);
            for (int32_t i = 3; i < 9; i++) {
                gain[i] = FS_LIT(0.0);
            }
            for (int32_t i = 12; i < 15; i++) {
                gain[i] = FS_LIT(0.0);
            }
            if (holds == FS_HOLDS_TILT_AND_GYRO) {
                gain[9] = FS_LIT(0.0);
                gain[10] = FS_LIT(0.0);
            }
        }
    }
}

/*
 * Correct state and covariance with gain: P h' / variance, or zero for a state that keeps its value.
 *
 * Joseph's form with such a gain subtracts P h' h P / variance from the covariance, except between two states that
 * both keep their values: one product for each element instead of two.
 *
 * kalman.py:133
 */
static void correct(fs_filter *f, fs_real innovation)
{
    for (int32_t i = 0; i < 27; i++) {
        fs_real share;
        if (f->gain[i] != FS_LIT(0.0)) {
            share = f->gain[i];
            for (int32_t j = i; j < 27; j++) {
                f->covariance[i][j] -= share * f->ph[j];
            }
        } else {
            if (f->ph[i] != FS_LIT(0.0)) {
                share = f->ph[i];
                for (int32_t j = i; j < 27; j++) {
                    f->covariance[i][j] -= share * f->gain[j];
                }
            }
        }
        f->covariance[i][i] = fs_max(f->covariance[i][i], FS_LIT(1e-12));
    }
    fs_correct(f->nominal, f->gain, innovation);
}

/* kalman.py:199 */
bool fs_fuse(fs_filter *f, int32_t row, fs_real innovation, const fs_noise *noise, fs_real holds)
{
    fs_observed *o = &f->observations[row];
    const fs_real least = noise->least * noise->least;
    const fs_real largest = noise->largest * noise->largest;
    const fs_real r = fs_min(fs_max(o->noise > FS_LIT(0.0) ? o->noise : noise->start * noise->start, least), largest);
    const fs_real projected = project(f);
    const fs_real expected = projected + r;
    fs_real variance = expected;
    o->variance = expected;
    if (noise->kind != FS_WHITE) {
        variance = projected + r * fs_correlation_factor(o);
    }
    const fs_real last = o->innovation;
    const fs_real ratio = innovation * innovation / (noise->gate * noise->gate * variance);
    o->innovation = innovation;
    o->test_ratio = ratio;
    if (!(ratio <= FS_LIT(1.0))) {
        o->refused += FS_LIT(1.0);
        if (noise->kind == FS_SLOW && fs_abs(innovation) < noise->start) {
            o->noise = fs_min(r + FS_ADAPTATION * (innovation * innovation - expected), largest);
        }
        return false;
    }
    o->fused += FS_LIT(1.0);
    o->nis_sum += innovation * innovation / expected;
    adapt_noise(o, r, projected, last, noise);
    for (int32_t i = 0; i < 27; i++) {
        f->gain[i] = f->ph[i] / variance;
    }
    hold(f->gain, holds);
    correct(f, innovation);
    o->fused_s = f->clock[0];
    return true;
}

/* kalman.py:247 */
fs_real fs_deviation(const fs_filter *f, int32_t at, int32_t count)
{
    fs_real total = FS_LIT(0.0);
    for (int32_t i = at; i < at + count; i++) {
        total += f->covariance[i][i];
    }
    return fs_sqrt(total);
}
