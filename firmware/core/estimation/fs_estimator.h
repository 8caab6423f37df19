/* Generated from Python by flightstack.firmware.generator: do not edit. */
#ifndef FS_ESTIMATOR_H
#define FS_ESTIMATOR_H

#include "fs_clock_origin.h"
#include "fs_delayed_filter.h"
#include "fs_health.h"
#include "fs_memory.h"

/*
 * The estimator. Its memory starts with zeros, as static memory does; then set the parameters and call
 * fs_start_memory. Rows of fs_push_kernel begin with the time [s] at which the sensor measured.
 */
#define FS_GNSS_RING 0
#define FS_MAG_RING 1
#define FS_BARO_RING 2
#define FS_RANGE_RING 3
#define FS_GNSS_VELOCITY 0
#define FS_GNSS_POSITION 3
#define FS_BARO 6
#define FS_MAG 7

extern const fs_estimator_params fs_default_estimator_params;

#endif
