/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Yaw: the magnetometer with the Earth's field, and GNSS velocity through the bank of yaw models.
 * flightstack/estimation/yaw_sources.py
 */
#ifndef FS_YAW_SOURCES_H
#define FS_YAW_SOURCES_H

#include "fs_alignment.h"
#include "fs_estimator_params.h"
#include "fs_imu_input.h"
#include "fs_kalman.h"
#include "fs_memory.h"
#include "fs_prediction.h"
#include "fs_rate_filter.h"
#include "fs_rings.h"
#include "fs_source_checks.h"
#include "fs_types.h"
#include "fs_yaw_estimator.h"

/* Move the models over a step of the flight. yaw_sources.py:182 */
void fs_predict_yaw(fs_estimator_memory *m, const fs_filter *f, const fs_delta_sample *step);

/*
 * Correct yaw and field with the Earth's field when it has become known; return the next stage.
 *
 * On the ground, or if it is far off, the yaw is aligned again, and the measured field is fused. In flight the yaw
 * changes as far as it depends on the field: by its declination first, then by its three components.
 *
 * yaw_sources.py:99
 */
int32_t fs_take_earth_field(fs_estimator_memory *m, fs_filter *f, int32_t stage, const fs_estimator_params *params);

/*
 * Fuse an axis of a magnetic field, and return the next one, 0 after the last.
 *
 * The first field after the alignment gives the yaw if that is unknown.
 *
 * yaw_sources.py:65
 */
int32_t fs_take_field(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t axis,
                      const fs_estimator_params *params);

/* Weigh the models with a GNSS velocity; reset the yaw if it is unknown, or wrong. yaw_sources.py:191 */
void fs_take_velocity(fs_estimator_memory *m, fs_filter *f, const fs_real row[]);

#endif
