/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The output at the rate of the IMU: integrates each sample and follows the filter, which is late by its delay.
 * flightstack/estimation/output_predictor.py
 */
#ifndef FS_OUTPUT_PREDICTOR_H
#define FS_OUTPUT_PREDICTOR_H

#include "fs_prediction.h"
#include "fs_rings.h"
#include "fs_types.h"

/* Change of the filter's state that a row of the track follows. */
typedef struct {
    fs_quaternion turn;
    fs_vector3 north;
    fs_vector3 east;
    fs_vector3 down;
    fs_vector3 speed_m_s;
    fs_vector3 before_m;
    fs_vector3 after_m;
    fs_real start_s;
} fs__change;

/* Write a row of the track. output_predictor.py:29 */
void fs_write_motion(fs_real row[], fs_real time_s, const fs_motion *motion);

/* Read a row of the track, shape (11,): time, attitude, velocity, position. output_predictor.py:23 */
fs_motion fs_read_motion(const fs_real row[]);

/*
 * Move the output and the track by share of the filter's difference to the track's oldest row.
 *
 * target is the filter's state at the time of that row. Times after it are corrected for the effect of the difference
 * until then.
 *
 * output_predictor.py:103
 */
void fs_follow(fs_rings *rings, fs_real output[], const fs_motion *target, fs_real share, fs_real gravity);

#endif
