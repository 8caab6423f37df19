/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Ring buffers of rows of floats, for measurements that wait until the delayed horizon reaches their time.
 * flightstack/estimation/rings.py
 */
#ifndef FS_RINGS_H
#define FS_RINGS_H

#include "fs_types.h"

/* Mean of samples. Equal samples have exactly their value as mean. */
typedef struct {
    fs_real sums[4];
    fs_real number;
    fs_real pushed_s;
    fs_real last_s;
    fs_real first[4];
} fs_mean;

/* A DeltaSample. */
typedef struct {
    fs_real time_s;
    fs_real dt_s;
    fs_real angle_rad[3];
    fs_real velocity_m_s[3];
    fs_real unknown_angle;
    fs_real unknown_velocity;
} fs_step_row;

/* Rows of a ring that are in use. */
typedef struct {
    int32_t oldest;
    int32_t rows;
} fs_cursor;

/* Measurements in the order of their arrival; the first column of each row of floats is the time. */
typedef struct {
    fs_real gnss[8][10];
    fs_real mag[32][4];
    fs_real baro[32][2];
    fs_real range[32][2];
    fs_step_row imu[64];
    fs_real track[64][11];
    fs_cursor cursors[5];
} fs_rings;

/* Return the number of rows that wait. rings.py:84 */
int32_t fs_count_of(const fs_rings *rings, int32_t ring);

/* Return the slot of row number, counted from the oldest. rings.py:70 */
int32_t fs_slot_of(const fs_rings *rings, int32_t ring, int32_t size, int32_t number);

/* Return the time of the newest row of GNSS, or minus infinity. rings.py:136 */
fs_real fs_newest_fix_time(const fs_rings *rings);

/* Remove the oldest row. rings.py:108 */
void fs_pop(fs_rings *rings, int32_t ring, int32_t size);

/* Return the slot for a new row; the oldest row of a full ring is dropped. rings.py:97 */
int32_t fs_push(fs_rings *rings, int32_t ring, int32_t size);

/* Copy the first values to a row. rings.py:153 */
void fs_write_row(fs_real row[], int32_t row_size, const fs_real values[]);

/* Add a sample to a mean; return True, with the mean in row, if period_s passed since the last one. rings.py:116 */
bool fs_take_mean(fs_mean *mean, fs_real row[], int32_t row_size, fs_real period_s);

/* Return the slot of the oldest row. rings.py:77 */
int32_t fs_oldest_slot(const fs_rings *rings, int32_t ring);

/* Return True if the ring has rows and oldest, its oldest one, was not measured in the future. rings.py:91 */
bool fs_is_due(const fs_rings *rings, int32_t ring, const fs_real oldest[], fs_real now_s);

/* Copy a row to the first of values. rings.py:146 */
void fs_read_row(const fs_real row[], int32_t row_size, fs_real values[]);

#endif
