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

/* What the estimator's memory says of EstimateHealth. */
typedef struct {
    fs_real mean_ratios[10];
    fs_real mean_squares[10];
    fs_real unaided_s;
    fs_real refused_s;
    fs_real lag_s;
    fs_real horizontal_m;
    fs_real velocity_m_s;
    fs_real tilt_rad;
    fs_real gyro_bias_rad_s;
    fs_real accel_bias_m_s2;
    fs_real velocity_ratio;
    fs_real position_ratio;
    fs_real height_ratio;
    fs_real heading_ratio;
} fs_health_summary;

/* Write the summary of an estimator's memory. health.py:161 */
void fs_health_kernel(const fs_estimator_memory *memory, fs_health_summary *summary);

#endif
