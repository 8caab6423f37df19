/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* The memory of one estimator: a record. flightstack/estimation/memory.py */
#ifndef FS_MEMORY_H
#define FS_MEMORY_H

#include "fs_alignment.h"
#include "fs_estimator_params.h"
#include "fs_imu_input.h"
#include "fs_kalman.h"
#include "fs_rate_filter.h"
#include "fs_rings.h"
#include "fs_source_checks.h"
#include "fs_types.h"
#include "fs_yaw_estimator.h"

/* Time without samples of the IMU in all, and the number of such gaps. */
typedef struct {
    fs_real total_s;
    fs_real number;
} fs_gaps;

/* Horizontal position that is held. */
typedef struct {
    fs_real place_m[2];
    fs_real fused_s;
} fs_hold;

/* What the estimator knows, 1 if it is true. */
typedef struct {
    int32_t aligned;
    int32_t landed;
    int32_t has_baro;
    int32_t has_gnss;
    int32_t has_range;
    int32_t has_mag;
    int32_t has_yaw;
    int32_t mag_fault;
    int32_t field_is_new;
} fs_flags;

/* Comparison of the filter's yaw with that of GNSS velocity. */
typedef struct {
    fs_real turn_rad;
    fs_real variance;
    fs_real updates;
    fs_real wrong_s;
} fs_yaw_fix;

/* The open step. */
typedef struct {
    int32_t source;
    int32_t axis;
    int32_t has_fused;
} fs_agenda;

/* Resets of position or velocity, NED. */
typedef struct {
    fs_real number;
    fs_real change[3];
    fs_real sum[3];
    fs_real time_s;
} fs_reset;

/* Resets of the yaw: their number, the last change, and the sum of all. */
typedef struct {
    fs_real number;
    fs_real change_rad;
    fs_real sum_rad;
} fs_yaw_reset;

/* Resets of each kind. */
typedef struct {
    fs_reset position;
    fs_reset velocity;
    fs_yaw_reset yaw;
} fs_resets;

/* The state before the measurement of GNSS that is being fused. */
typedef struct {
    fs_real elapsed_s;
    fs_real outage_s;
    fs_real place_m[2];
    fs_real velocity_m_s[2];
} fs_before_gnss;

/* Parameters, state and waiting measurements of an estimator. */
typedef struct {
    fs_real output[11];
    fs_real state[13];
    fs_real last_imu_s;
    fs_gaps gaps;
    fs_real last_gnss_s;
    fs_real gnss_speed_m_s[2];
    fs_real refused_s[6];
    fs_real ground_m;
    fs_hold hold;
    fs_real rest_s;
    fs_real drag_s;
    fs_flags flags;
    fs_yaw_fix yaw_fix;
    fs_real followed;
    fs_agenda agenda;
    fs_real pending[10];
    fs_filter filter;
    fs_estimator_params params;
    fs_imu_sums sums;
    fs_mean means[5];
    fs_checks checks;
    fs_alignment alignment;
    fs_resets resets;
    fs_rate_filter rate_filter;
    fs_real earth[4];
    fs_real field[3];
    fs_before_gnss before_gnss;
    fs_yaw_bank yaw_bank;
    fs_rings rings;
} fs_estimator_memory;

/* Set what is not zero at the start in a memory of zeros that has its parameters. memory.py:175 */
void fs_start_memory(fs_estimator_memory *memory);

#endif
