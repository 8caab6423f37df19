#include "fs_rate_groups.h"

#include "fs_loops.h"

void fs_rate_groups_init(fs_rate_groups *groups, uint16_t divisor)
{
    groups->divisor = divisor > 0U ? divisor : 1U;
    groups->count = 0U;
}

uint16_t fs_rate_groups_tick(fs_rate_groups *groups)
{
    const uint16_t due = groups->count == 0U ? FS_OUTER_DUE : 0U;

    groups->count = (uint16_t)(groups->count + 1U);
    if (groups->count >= groups->divisor) {
        groups->count = 0U;
    }
    return due;
}
