/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Horizontal position and velocity: GNSS from its first fix to resets, and the position held without it.
 * flightstack/estimation/position_sources.py
 */
#ifndef FS_POSITION_SOURCES_H
#define FS_POSITION_SOURCES_H

#include "fs_estimator_params.h"
#include "fs_kalman.h"
#include "fs_memory.h"
#include "fs_rings.h"
#include "fs_types.h"

/* Return False if GNSS measures that what the vehicle stands on moves, as a boat does. position_sources.py:130 */
bool fs_is_platform_at_rest(const fs_estimator_memory *m, const fs_filter *f);

/* Return True if a GNSS velocity was accepted within the last second. position_sources.py:123 */
bool fs_is_velocity_measured(const fs_filter *f);

/*
 * Hold the horizontal position while the velocity is not measured; return True if it was fused.
 * position_sources.py:138
 */
bool fs_hold_position(fs_estimator_memory *m, fs_filter *f, const fs_estimator_params *params);

/*
 * Fuse a GNSS measurement; without a known yaw only its vertical parts. Reset what was refused too long.
 * position_sources.py:48
 */
void fs_take_gnss(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params);

#endif
