/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Height: the barometer and its bias, the range finder above level ground, and resets to GNSS.
 * flightstack/estimation/height_sources.py
 */
#ifndef FS_HEIGHT_SOURCES_H
#define FS_HEIGHT_SOURCES_H

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
 * Fuse a pressure altitude. The first one, and the first after the barometer was stuck, gives its bias.
 *
 * So does one that follows a series of refused ones while GNSS velocity is accepted.
 *
 * height_sources.py:21
 */
void fs_take_baro(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params);

/* Fuse a distance. The first one, and the first after a loss, gives the height of the ground. height_sources.py:60 */
void fs_take_range(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params);

/* Set the height to that of GNSS; barometer and range finder start again from it. height_sources.py:75 */
void fs_reset_height(fs_estimator_memory *m, fs_filter *f, const fs_real row[]);

#endif
