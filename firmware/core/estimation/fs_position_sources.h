/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Horizontal position and velocity: GNSS from its first fix to resets, and the position held without it.
 * flightstack/estimation/position_sources.py
 */
#ifndef FS_POSITION_SOURCES_H
#define FS_POSITION_SOURCES_H

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

/* Return True if a GNSS velocity was accepted within the last second. position_sources.py:170 */
bool fs_is_velocity_measured(const fs_filter *f);

/* Return False if GNSS measures that what the vehicle stands on moves, as a boat does. position_sources.py:177 */
bool fs_is_platform_at_rest(const fs_estimator_memory *m, const fs_filter *f);

/*
 * Hold the horizontal position while the velocity is not measured, north before east; return the next axis.
 * position_sources.py:185
 */
int32_t fs_hold_position(fs_estimator_memory *m, fs_filter *f, int32_t axis, const fs_estimator_params *params);

/*
 * Fuse a scalar of a GNSS measurement: three velocities, three positions; return the next stage.
 *
 * Without a known yaw only the vertical parts count. The last one resets what was refused too long.
 *
 * position_sources.py:52
 */
int32_t fs_take_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], int32_t stage,
                     const fs_estimator_params *params);

#endif
