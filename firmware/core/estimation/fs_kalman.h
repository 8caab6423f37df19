/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Scalar measurement updates of the error-state Kalman filter, with gates and adaptive measurement noise.
 * flightstack/estimation/kalman.py
 */
#ifndef FS_KALMAN_H
#define FS_KALMAN_H

#include "fs_types.h"

/* What the filter knows of the measurements of one quantity. */
typedef struct {
    fs_real innovation;
    fs_real variance;
    fs_real test_ratio;
    fs_real fused_s;
    fs_real noise;
    fs_real lagged;
    fs_real fused;
    fs_real refused;
    fs_real nis_sum;
} fs_observed;

/* The filter's arrays, all written in place. */
typedef struct {
    fs_real nominal[28];
    fs_real h[27];
    fs_real ph[27];
    fs_real gain[27];
    fs_real clock[2];
    fs_real behind[7];
    fs_real turn[3];
    fs_real drag[2];
    fs_real covariance[27][27];
    fs_observed observations[25];
} fs_filter;

/* Range of a measurement's noise [1sigma]. The filter estimates the noise within it from its innovations. */
typedef struct {
    fs_real least;
    fs_real start;
    fs_real largest;
    fs_real gate;
    fs_real kind;
} fs_noise;

/* Make count states from at independent of all others, each with variance. kalman.py:236 */
void fs_reset_variance(fs_real p[27][27], int32_t at, int32_t count, fs_real variance);

/* Set every item to zero. kalman.py:104 */
void fs_clear(fs_real x[27]);

/* Return the factor by which the noise of a mean is larger than that of independent measurements. kalman.py:191 */
fs_real fs_correlation_factor(const fs_observed *o);

/*
 * Fuse a scalar measurement with the Jacobian f.h; return True if it is within its gate.
 *
 * A refused one that is smaller than the noise at the start moves the noise even so: a slow error, such as that of
 * soft iron on another heading, else had an axis refused for good.
 *
 * With holds other than zero, these states keep their values and their uncertainty: a Schmidt-Kalman update.
 *
 * kalman.py:199
 */
bool fs_fuse(fs_filter *f, int32_t row, fs_real innovation, const fs_noise *noise, fs_real holds);

/* Return the root of the summed variances of count states from at. kalman.py:247 */
fs_real fs_deviation(const fs_filter *f, int32_t at, int32_t count);

#endif
