/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The origin of the filter's clock, which moves: single precision has no milliseconds after some hours.
 * flightstack/estimation/clock_origin.py
 */
#ifndef FS_CLOCK_ORIGIN_H
#define FS_CLOCK_ORIGIN_H

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
 * Let all times in the memory count from an origin that is by_s later; samples from now on do so too.
 * clock_origin.py:102
 */
void fs_move_clock_kernel(fs_estimator_memory *memory, fs_real by_s);

#endif
