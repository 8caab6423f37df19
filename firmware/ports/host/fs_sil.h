/*
 * The loops for a program on the host that computes with double: software in the loop.
 *
 * Numbers go in and out as double and are rounded to fs_real on the way in, as a link to a target does it.
 */
#ifndef FS_SIL_H
#define FS_SIL_H

#include "fs_loops.h"

#define FS_SIL_INPUT 29U  /* state 13, setpoint 11, attitude target 5 */
#define FS_SIL_OUTPUT 32U /* attitude target 5, reference 10, wrench 4, wrench achieved 4, rotor commands 8, status */

#define FS_SIL_DONE 0U
#define FS_SIL_REFUSED 1U
#define FS_SIL_UNKNOWN 2U

uint32_t fs_sil_size(void);      /* octets of fs_loops, which the caller owns */
uint32_t fs_sil_real_size(void); /* octets of fs_real: 4 or 8 */
void fs_sil_init(fs_loops *loops);

/* One tick with FS_OUTER_DUE, FS_SET_TARGET and FS_RESET in flags; arrays of FS_SIL_INPUT and FS_SIL_OUTPUT. */
void fs_sil_step(fs_loops *loops, const double *input, uint32_t flags, double *output);

/* Change a parameter by its name; FS_SIL_DONE, FS_SIL_REFUSED or FS_SIL_UNKNOWN. */
uint32_t fs_sil_set(fs_loops *loops, const char *name, double value);

/* Value of a parameter; 0 for a name that is not known. */
double fs_sil_get(const fs_loops *loops, const char *name);

#endif
