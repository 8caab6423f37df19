/* FS_PIL_STEP and FS_PIL_REPORT, and what the loops take and give. */
#ifndef FS_APP_PIL_DATA_H
#define FS_APP_PIL_DATA_H

#include "fs_loops.h"
#include "fs_messages.h"

/* Tell whether two steps have the same number, flags and bits. */
uint16_t fs_pil_is_same(const fs_pil_step *one, const fs_pil_step *other);

/*
 * Return what is wrong with a step, to be told: a number that its flags make an input is not finite, or the flags are
 * none that this target knows, or ask for two meanings of the setpoint at once. NULL when it is sound.
 */
const char *fs_pil_fault_of(const fs_pil_step *step);

/* The setpoint's numbers are a setpoint or an attitude target: both are written, the flags tell the loops which to read. */
void fs_pil_to_input(const fs_pil_step *step, fs_loop_input *input);

/* Write everything but the step's number; of the status the loops' 16 bits. */
void fs_pil_to_report(const fs_loop_output *output, const fs_loop_cost *cost, fs_pil_report *report);

#endif
