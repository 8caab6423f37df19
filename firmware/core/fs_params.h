/* The numbers of the loops as parameters: by index and by name. Names, ranges and defaults come from Python. */
#ifndef FS_PARAMS_H
#define FS_PARAMS_H

#include "fs_loops.h"

#define FS_PARAM_DONE 0U
#define FS_PARAM_REFUSED 1U
#define FS_PARAM_NAME_SIZE 16U /* characters of a name at most */

uint16_t fs_param_count(void);

/* Name of a parameter, ending at NUL; the empty name for an index beyond the table. */
const char *fs_param_name(uint16_t index);

/* Whether two names are the same, each ending at NUL or after 16 characters. */
uint16_t fs_param_same_name(const char *a, const char *b);

/* Index of a name that ends at NUL or after 16 characters; -1 when there is none. */
int16_t fs_param_find(const char *name16);

/* Value as it was set; 0 for an index beyond the table. */
fs_real fs_param_get(const fs_loops *loops, uint16_t index);

/*
 * Change a parameter from the next tick on. FS_PARAM_REFUSED, and nothing is changed, for a value that is out of
 * range, not finite, not whole where it must be, or on the wrong side of another parameter: the least thrust must not be
 * above the largest one.
 *
 * An integral that the gain multiplies is scaled, so that the product stays. Another attitude law starts without
 * memory.
 */
uint16_t fs_param_set(fs_loops *loops, uint16_t index, fs_real value);

/* Give every parameter its default. */
void fs_params_reset(fs_loops *loops);

#endif
