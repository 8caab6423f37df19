/* Which loops are due in a tick of the inner loop, for a target that runs by its own timer. */
#ifndef FS_RATE_GROUPS_H
#define FS_RATE_GROUPS_H

#include "fs_real.h"

typedef struct {
    uint16_t divisor; /* inner ticks in an outer period, 1 at least */
    uint16_t count;   /* ticks since the outer loop was due */
} fs_rate_groups;

/* The outer loop is due in the first tick and in every divisor-th one after; 0 counts as 1. */
void fs_rate_groups_init(fs_rate_groups *groups, uint16_t divisor);

/* Count a tick; return FS_OUTER_DUE or 0. */
uint16_t fs_rate_groups_tick(fs_rate_groups *groups);

#endif
