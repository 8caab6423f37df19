/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The filter's work in parts: a prediction, then one scalar measurement at a time, so that no sample waits for all.
 * flightstack/estimation/agenda.py
 */
#ifndef FS_AGENDA_H
#define FS_AGENDA_H

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

/* Fuse the next scalar of the source at hand. agenda.py:186 */
int32_t fs_fuse_next(fs_estimator_memory *m, fs_filter *f, fs_rings *r, const fs_estimator_params *params);

/*
 * Do the next part of the work; return False if no step older than the horizon is open or waits.
 *
 * A part is one scalar, with the prediction if that is due, or the end of a step.
 *
 * agenda.py:92
 */
bool fs_work(fs_estimator_memory *m, fs_filter *f, fs_rings *r, fs_real horizon_s, const fs_estimator_params *params);

/*
 * Correct the filter with the Earth's field now, after the open step: a vehicle that is ready may arm next.
 * agenda.py:116
 */
void fs_take_field_at_rest(fs_estimator_memory *m, fs_filter *f, fs_rings *r, const fs_estimator_params *params);

#endif
