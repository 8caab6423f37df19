/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).
 * flightstack/estimation/rate_filter.py
 */
#ifndef FS_RATE_FILTER_H
#define FS_RATE_FILTER_H

#include "fs_types.h"

/*
 * Return the rates [rad/s] behind the filter; unchanged if cutoff_hz is 0 or near half the sample rate.
 * rate_filter.py:45
 */
fs_vector3 fs_filtered_rates(fs_real x[9], const fs_vector3 *gyro, fs_real dt_s, fs_real cutoff_hz);

#endif
