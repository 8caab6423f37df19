/* Apart from steps.c, because the codec's type for PARAM_SET and the loops' function to set a number share a name. */
#include "fs_params.h"

uint16_t steps_set(fs_loops *loops, const char *name, float value);

uint16_t steps_set(fs_loops *loops, const char *name, float value)
{
    const int16_t index = fs_param_find(name);

    return (index < 0) ? 1U : fs_param_set(loops, (uint16_t)index, value);
}
