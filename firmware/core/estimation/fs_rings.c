/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Ring buffers of rows of floats, for measurements that wait until the delayed horizon reaches their time.
 * flightstack/estimation/rings.py
 */
#include "fs_rings.h"

#include "fs_law_math.h"
#include "fs_math.h"

#define FS_GNSS_RING 0
#define FS_GNSS_ROWS 8
#define FS_ROUNDING_S FS_LIT(0.00025)

/* rings.py:84 */
int32_t fs_count_of(const fs_rings *rings, int32_t ring)
{
    const int32_t count = rings->cursors[ring].rows;
    return count;
}

/* rings.py:70 */
int32_t fs_slot_of(const fs_rings *rings, int32_t ring, int32_t size, int32_t number)
{
    const int32_t slot = rings->cursors[ring].oldest + number;
    return slot >= size ? slot - size : slot;
}

/* rings.py:136 */
fs_real fs_newest_fix_time(const fs_rings *rings)
{
    const int32_t count = fs_count_of(rings, FS_GNSS_RING);
    if (count == 0) {
        return -FS_INFINITY;
    }
    const fs_real newest_s = rings->gnss[fs_slot_of(rings, FS_GNSS_RING, FS_GNSS_ROWS, count - 1)][0];
    return newest_s;
}

/* rings.py:108 */
void fs_pop(fs_rings *rings, int32_t ring, int32_t size)
{
    fs_cursor *cursor = &rings->cursors[ring];
    cursor->oldest = fs_slot_of(rings, ring, size, 1);
    cursor->rows -= 1;
}

/* rings.py:97 */
int32_t fs_push(fs_rings *rings, int32_t ring, int32_t size)
{
    fs_cursor *cursor = &rings->cursors[ring];
    if (cursor->rows >= size) {
        fs_pop(rings, ring, size);
    }
    const int32_t slot = fs_slot_of(rings, ring, size, cursor->rows);
    cursor->rows += 1;
    return slot;
}

/* rings.py:153 */
void fs_write_row(fs_real row[], int32_t row_size, const fs_real values[])
{
    for (int32_t column = 0; column < row_size; column++) {
        row[column] = values[column];
    }
}

/* rings.py:116 */
bool fs_take_mean(fs_mean *mean, fs_real row[], int32_t row_size, fs_real period_s)
{
    if (row[0] - mean->last_s > period_s) { /* a gap: the older samples are outdated */
        mean->number = FS_LIT(0.0);
    }
    mean->last_s = row[0];
    for (int32_t i = 0; i < row_size; i++) {
        if (mean->number == FS_LIT(0.0)) {
            mean->first[i] = row[i];
            mean->sums[i] = FS_LIT(0.0);
        }
        mean->sums[i] += row[i] - mean->first[i];
    }
    mean->number += FS_LIT(1.0);
    if (row[0] - mean->pushed_s < FS_LIT(0.9) * period_s) {
        return false;
    }
    mean->pushed_s = row[0];
    for (int32_t i = 0; i < row_size; i++) {
        row[i] = mean->first[i] + mean->sums[i] / mean->number;
    }
    mean->number = FS_LIT(0.0);
    return true;
}

/* rings.py:77 */
int32_t fs_oldest_slot(const fs_rings *rings, int32_t ring)
{
    const int32_t slot = rings->cursors[ring].oldest;
    return slot;
}

/* rings.py:91 */
bool fs_is_due(const fs_rings *rings, int32_t ring, const fs_real oldest[], fs_real now_s)
{
    return fs_count_of(rings, ring) > 0 && oldest[0] <= now_s + FS_ROUNDING_S;
}

/* rings.py:146 */
void fs_read_row(const fs_real row[], int32_t row_size, fs_real values[])
{
    for (int32_t column = 0; column < row_size; column++) {
        values[column] = row[column];
    }
}
