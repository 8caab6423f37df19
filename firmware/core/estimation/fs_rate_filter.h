/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).
 * flightstack/estimation/rate_filter.py
 */
#ifndef FS_RATE_FILTER_H
#define FS_RATE_FILTER_H

#include "fs_types.h"

/* State of the filter. */
typedef struct {
    fs_real band[3];
    fs_real low[3];
    fs_real step_s;
    fs_real cutoff_hz;
    fs_real factor;
} fs_rate_filter;

/*
 * Return the rates [rad/s] behind the filter; unchanged if cutoff_hz is 0 or near half the sample rate.
 * rate_filter.py:56
 */
fs_vector3 fs_filtered_rates(fs_rate_filter *x, const fs_vector3 *gyro, fs_real dt_s, fs_real cutoff_hz);

#endif
