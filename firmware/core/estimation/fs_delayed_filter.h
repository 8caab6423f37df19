/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Entry points of the filter: measurements wait until the delayed horizon reaches them, IMU samples move it.
 * flightstack/estimation/delayed_filter.py
 */
#ifndef FS_DELAYED_FILTER_H
#define FS_DELAYED_FILTER_H

#include "fs_alignment.h"
#include "fs_estimator_params.h"
#include "fs_imu_input.h"
#include "fs_kalman.h"
#include "fs_memory.h"
#include "fs_rate_filter.h"
#include "fs_rings.h"
#include "fs_source_checks.h"
#include "fs_types.h"
#include "fs_yaw_estimator.h"

/*
 * Store a measurement of a ring (GNSS_RING, to) until the horizon reaches its time.
 *
 * A measurement that is not finite is dropped; only the accuracies of GNSS, behind its velocity, may be missing. row
 * may change.
 *
 * delayed_filter.py:63
 */
void fs_push_kernel(fs_estimator_memory *memory, int32_t ring, fs_real row[], int32_t row_size);

/*
 * Take an IMU sample, shape (8,): move the output, and the filter when a step is complete.
 *
 * A sample that is not finite, or without a step in time, or not later than the last one, is dropped. Time without
 * samples is bridged by the next sample.
 *
 * delayed_filter.py:105
 */
void fs_imu_kernel(fs_estimator_memory *memory, const fs_real sample[]);

/*
 * Correct the filter with the Earth's field in earth: on the ground at once, in flight in its next step.
 * delayed_filter.py:165
 */
void fs_field_kernel(fs_estimator_memory *memory);

#endif
