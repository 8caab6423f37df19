/* The place of the estimator in an image of which only the loops are used: no event is valid. */
#include "fs_sensing.h"

uint16_t fs_sensing_take(const fs_pil_sense *event, fs_pil_estimate *estimate)
{
    (void)event;
    (void)estimate;
    return 0U;
}

void fs_sensing_read(fs_pil_memory *words)
{
    (void)words;
}
