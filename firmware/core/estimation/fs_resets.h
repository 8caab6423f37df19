/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Resets: a part of the state is set to a measurement, and its change is counted for guidance and position control.
 * flightstack/estimation/resets.py
 */
#ifndef FS_RESETS_H
#define FS_RESETS_H

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

/* Count a change of the yaw. resets.py:74 */
void fs_count_yaw_reset(fs_estimator_memory *m, fs_real turn_rad);

/* Set count axes of the velocity from first to a GNSS measurement. resets.py:16 */
void fs_reset_velocity(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t first, int32_t count);

/* Set count axes of the position from first to a GNSS measurement. resets.py:28 */
void fs_reset_position(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t first, int32_t count);

/* Count a horizontal change of position and velocity as resets of both. resets.py:44 */
void fs_count_correction(fs_estimator_memory *m, const fs_filter *f, fs_real north_m, fs_real east_m,
                         fs_real north_m_s, fs_real east_m_s);

/* Return the number of resets of any kind. resets.py:83 */
fs_real fs_count_of_resets(const fs_estimator_memory *m);

#endif
