/* The generated table of parameters: for fs_params.c alone. */
#ifndef FS_PARAM_TABLE_H
#define FS_PARAM_TABLE_H

#include "fs_loops.h"

typedef struct {
    const char *name;
    fs_real low, high, initial;
    uint16_t is_whole;
} fs_param_spec;

/* Declaration of a parameter; the index must be below FS_PARAM_COUNT. */
const fs_param_spec *fs_param_spec_at(uint16_t index);

/* Where a parameter's number stands; NULL for an index beyond the table. */
fs_real *fs_param_place(fs_loops *loops, uint16_t index);

/* The number itself; 0 for an index beyond the table. */
fs_real fs_param_value(const fs_loops *loops, uint16_t index);

/* Whether each pair of numbers is in order: 1 or 0. */
uint16_t fs_param_is_consistent(const fs_loops *loops);

/* The memory that a gain multiplies; NULL when it multiplies none. */
fs_real *fs_param_integral(fs_loops *loops, uint16_t index);

#endif
