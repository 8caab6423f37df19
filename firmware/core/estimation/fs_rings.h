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

/* Measurements in the order of their arrival; the first column of each row is the time. */
typedef struct {
    fs_real gnss[8][10];
    fs_real mag[32][4];
    fs_real baro[32][2];
    fs_real range[32][2];
    fs_real imu[64][10];
    fs_real track[64][11];
    int32_t cursors[5][2];
} fs_rings;

/* Return the slot of row number, counted from the oldest. rings.py:52 */
int32_t fs_slot_of(const fs_rings *rings, int32_t ring, int32_t size, int32_t number);

/* Return the time of the newest row of GNSS, or minus infinity. rings.py:112 */
fs_real fs_newest_fix_time(const fs_rings *rings);

/* Remove the oldest row. rings.py:85 */
void fs_pop(fs_rings *rings, int32_t ring, int32_t size);

/* Return the slot for a new row; the oldest row of a full ring is dropped. rings.py:75 */
int32_t fs_push(fs_rings *rings, int32_t ring, int32_t size);

/* Copy the first values to a row. rings.py:129 */
void fs_write_row(fs_real row[], int32_t row_size, const fs_real values[]);

/* Add a sample to a mean; return True, with the mean in row, if period_s passed since the last one. rings.py:92 */
bool fs_take_mean(fs_mean *mean, fs_real row[], int32_t row_size, fs_real period_s);

/* Return True if the ring has rows and its oldest one, measured at row_s, is not in the future. rings.py:68 */
bool fs_is_due(const fs_rings *rings, int32_t ring, fs_real row_s, fs_real now_s);

/* Copy a row to the first of values. rings.py:122 */
void fs_read_row(const fs_real row[], int32_t row_size, fs_real values[]);

#endif
