/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* The memory of one estimator: a record. flightstack/estimation/memory.py */
#include "fs_memory.h"

#include "fs_law_math.h"
#include "fs_math.h"

/* memory.py:175 */
void fs_start_memory(fs_estimator_memory *memory)
{
    fs_estimator_memory *m = memory;
    const fs_estimator_params *params = &m->params;
    m->sums.rotation[0] = FS_LIT(1.0);
    m->filter.clock[1] = params->imu_noise_share;
    m->earth[3] = FS_NAN;
}
