/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Health of an estimate: what commander and arming checks need to know of it. flightstack/estimation/health.py */
#ifndef FS_HEALTH_H
#define FS_HEALTH_H

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
 * Write the summary of an estimator's record, shape (12,); it holds the mean ratios of the last call. health.py:104
 */
void fs_health_kernel(const fs_estimator_memory *memory, fs_real summary[12]);

#endif
