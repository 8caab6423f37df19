/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The memory of one estimator: a record of arrays, the meaning of its flags and of its counters of resets.
 * flightstack/estimation/memory.py
 */
#ifndef FS_MEMORY_H
#define FS_MEMORY_H

#include "fs_estimator_params.h"
#include "fs_kalman.h"
#include "fs_rings.h"
#include "fs_types.h"

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

/* Parameters, state and waiting measurements of an estimator. */
typedef struct {
    fs_real output[11];
    fs_real state[13];
    fs_real last_imu_s[1];
    fs_real imu_gap[2];
    fs_real last_gnss_s[1];
    fs_real gnss_speed_m_s[2];
    fs_real refused_s[6];
    fs_real ground_m[1];
    fs_real hold[3];
    fs_real rest_s[1];
    fs_real drag_s[1];
    fs_flags flags;
    fs_real yaw_fix[4];
    fs_real followed[1];
    int32_t agenda[3];
    fs_real pending[10];
    fs_filter filter;
    fs_estimator_params params;
    fs_real sums[64];
    fs_real means[5][11];
    fs_real checks[30];
    fs_real alignment[9];
    fs_real resets[19];
    fs_real rate_filter[9];
    fs_real earth[4];
    fs_real field[3];
    fs_real before_gnss[6];
    fs_real yaw_models[5][32];
    fs_rings rings;
} fs_estimator_memory;

/* Set what is not zero at the start in a memory of zeros that has its parameters. memory.py:112 */
void fs_start_memory(fs_estimator_memory *memory);

#endif
