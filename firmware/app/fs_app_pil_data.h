/* FS_PIL_STEP and FS_PIL_REPORT, their short forms FS_PIL_TICK and FS_PIL_OUTPUT, and what the loops take and give. */
#ifndef FS_APP_PIL_DATA_H
#define FS_APP_PIL_DATA_H

#include "fs_loops.h"
#include "fs_messages.h"

/* Tell whether two steps have the same number, flags and bits. */
uint16_t fs_pil_is_same(const fs_pil_step *one, const fs_pil_step *other);

/*
 * Return the error of a step, for the report: a number that its flags make an input is not finite, or the flags are
 * none that this target knows, or ask for two meanings of the setpoint at once. NULL when it is sound.
 */
const char *fs_pil_fault_of(const fs_pil_step *step, uint16_t is_short);

#define FS_PIL_WANT_REFERENCE 8UL /* FS_PIL_TICK.flags, beside those of the loops */

/* Write the step that a short one stands for; what it leaves out is zero, and not read. */
void fs_pil_from_tick(const fs_pil_tick *tick, fs_pil_step *step);

#define FS_PIL_REST 16UL /* FS_PIL_STATE.flags, beside those of the loops */

/* Write the step that a state stands for in an outer tick; its number is the host's time. */
void fs_pil_from_state(const fs_pil_state *state, fs_pil_step *step);

/* Write the short form of a report; `flags` are the step's. */
void fs_pil_to_output(const fs_pil_report *report, uint32_t flags, uint16_t rotors, fs_pil_output *output);

/* The setpoint's numbers are a setpoint or an attitude target: both are written, the flags tell the loops which to read. */
void fs_pil_to_input(const fs_pil_step *step, fs_loop_input *input);

/* Write everything but the step's number; of the status the loops' 16 bits. */
void fs_pil_to_report(const fs_loop_output *output, const fs_loop_cost *cost, fs_pil_report *report);

#endif
