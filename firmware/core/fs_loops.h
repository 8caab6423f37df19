/*
 * The control loops: outer loop, attitude reference, attitude controller, mixer.
 *
 * The same as flightstack/control/loops.py. All that the loops know is in one structure that the caller owns; there
 * are no other variables. World frame NED, body frame FRD, SI units.
 */
#ifndef FS_LOOPS_H
#define FS_LOOPS_H

#include "fs_mixer_limits.h"
#include "fs_numbers.h"
#include "fs_types.h"

/* What the inner loop writes in each tick: contract.LoopRow without the inputs, which the host has anyway. */
typedef struct {
    fs_attitude_target attitude_target;
    fs_attitude_reference reference;
    fs_wrench wrench;
    fs_wrench wrench_achieved;
    fs_real rotor_command_rad_s[FS_MAX_ROTORS]; /* 0 beyond the rotors; negative with ideal rotors only */
    uint16_t status;                            /* FS_STATUS_* bits */
} fs_loop_output;

#define FS_OUTER_DUE 1U  /* run the outer loop on the setpoint */
#define FS_SET_TARGET 2U /* fly the target in place of the outer loop's, from this tick on */
#define FS_RESET 4U      /* forget the past first, at this state */

typedef struct {
    fs_vehicle_state state;
    fs_position_setpoint setpoint; /* read with FS_OUTER_DUE */
    fs_attitude_target target;     /* read with FS_SET_TARGET */
    uint16_t flags;
} fs_loop_input;

typedef uint32_t (*fs_clock)(void); /* cost counter of the port, counting up modulo 2^32 */

/*
 * What a step cost, in the clock's unit: differences modulo 2^32. The inner loop's part is reference filter and
 * attitude controller, without the mixer. All zero without a clock. Each includes the time of a clock reading, the whole
 * step one less than there were readings.
 */
typedef struct {
    uint32_t outer, inner, mixer, whole;
    uint16_t readings;
} fs_loop_cost;

/* What follows from the setup. */
typedef struct {
    uint16_t guidance, position, controller, mixing; /* indices of the laws */
    uint16_t rotors;
    fs_real inner_dt_s, outer_dt_s;
    fs_real fraction_step; /* share of an outer period that an inner tick is */
} fs_loop_rates;

typedef struct fs_loops {
    /* numbers: read and written through fs_params.h */
    fs_setup setup;
    fs_guidance_law_params guidance;
    fs_position_law_params position;
    fs_reference_params reference;
    fs_controller_params controller;
    fs_mixer_law_params mixing;
    fs_mixer mixer;
    fs_resolution resolution; /* of the mixer's sums */
    fs_loop_rates rates;
    /* memories */
    fs_guidance_law_memory guidance_memory;
    fs_position_law_memory position_memory;
    fs_reference_memory reference_memory;
    fs_controller_memory controller_memory;
    fs_mixer_law_memory mixing_memory;
    fs_attitude_target last_target; /* of the outer loop's tick before */
    fs_attitude_target target;
    uint16_t is_target_sound; /* 1: it is finite */
    fs_real fraction;         /* share of the outer period that has passed */
    fs_saturation saturation; /* of the last tick's mixer */
    fs_loop_output last;      /* of the last sound tick; repeated, with a status bit, when a tick is not sound */
} fs_loops;

/* Numbers of the default vehicle and gains; the memories as reset at the origin, level. */
void fs_loops_init(fs_loops *loops);

/* Set the memories of all laws to their initial values. */
void fs_loops_reset_laws(fs_loops *loops);

/* Forget the past: integrators zero, the reference at the present attitude, at rest. */
void fs_loops_reset(fs_loops *loops, const fs_vehicle_state *state);

/*
 * One inner tick: what the flags ask for, in the order RESET, SET_TARGET, OUTER_DUE, then inner loop and mixer.
 *
 * An input that is not finite never reaches a memory: the outer loop keeps its target, the inner loop repeats its
 * last output with FS_STATUS_INPUT_NOT_FINITE. The same with FS_STATUS_OUTPUT_NOT_FINITE when finite inputs are so
 * large that the result is not. The output is finite in every case, but for an attitude target that was set so, or
 * a reset at such a state, which takes another reset to recover from. clock may be NULL.
 */
void fs_loops_step(fs_loops *loops, const fs_loop_input *input, fs_clock clock, fs_loop_output *output,
                   fs_loop_cost *cost);

#endif
