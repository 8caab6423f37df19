/* Loops and codec without an application, for comparing processors: octets of FS_PIL_STEP and PARAM_SET frames go
 * in, and a hash of the octets of FS_PIL_REPORT frames comes out. Costs stay zero: every bit of a report is the
 * loops' own.
 */
#ifndef STEPS_H
#define STEPS_H

#include "fs_loops.h"
#include "fs_messages.h"
#include "fs_parser.h"

typedef struct {
    fs_loops loops;
    fs_parser parser;
    fs_frame frame;
    fs_pil_step step;
    fs_pil_report report;
    fs_loop_input input;
    fs_loop_output output;
    fs_clock clock; /* NULL but where instructions are counted */
    fs_loop_cost cost;
    fs_loop_cost most; /* the largest cost of each stage */
    fs_loop_cost sum;  /* of all steps */
    fs_octet payload[FS_MAX_PAYLOAD];
    fs_octet out[FS_MAX_FRAME];
    uint32_t steps;   /* computed */
    uint32_t refused; /* parameters that the loops did not take */
    uint32_t hash;    /* FNV-1a over all octets of all reports so far */
} steps;

void steps_init(steps *s, fs_clock clock);
uint16_t steps_push(steps *s, fs_octet octet); /* octets of the report that this octet brought about, in s->out */

/* steps_parameters.c: set one number of the loops; 1 when they do not take it */
uint16_t steps_set(fs_loops *loops, const char *name, float value);

#endif
