#include "fs_loops.h"

#include "fs_attitude_reference.h"
#include "fs_controllers.h"
#include "fs_geometry.h"
#include "fs_math.h"
#include "fs_params.h"

/* What a tick changes if it turns out sound. */
typedef struct {
    fs_reference_memory reference;
    fs_controller_memory controller;
    fs_mixer_law_memory mixing;
    fs_saturation saturation;
} fs_tick;

static const fs_vector3 no_vector = {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};

static uint32_t now(fs_clock clock)
{
    return clock != NULL ? clock() : 0UL;
}

/*
 * Every number is compared by itself: a sum would show an infinity only on a processor that makes NaN of the difference
 * of two.
 */
static uint16_t vector_is_finite(const fs_vector3 *v)
{
    return (uint16_t)(fs_is_finite(v->x) & fs_is_finite(v->y) & fs_is_finite(v->z));
}

static uint16_t quaternion_is_finite(const fs_quaternion *q)
{
    return (uint16_t)(fs_is_finite(q->w) & fs_is_finite(q->x) & fs_is_finite(q->y) & fs_is_finite(q->z));
}

static uint16_t state_is_finite(const fs_vehicle_state *state)
{
    return (uint16_t)(vector_is_finite(&state->position_ned_m) & vector_is_finite(&state->velocity_ned_m_s) &
                      quaternion_is_finite(&state->attitude) & vector_is_finite(&state->rates_frd_rad_s));
}

/* Finite, and a yaw that has a sine: a processor without NaN may make a number of what fs_sin_cos gives beyond. */
static uint16_t setpoint_is_sound(const fs_position_setpoint *setpoint)
{
    const uint16_t has_sine = fs_abs(setpoint->yaw_rad) <= FS_LARGEST_ANGLE_RAD ? 1U : 0U;

    return (uint16_t)(has_sine & vector_is_finite(&setpoint->position_ned_m) &
                      vector_is_finite(&setpoint->velocity_ned_m_s) &
                      vector_is_finite(&setpoint->acceleration_ned_m_s2) & fs_is_finite(setpoint->yaw_rate_rad_s));
}

static uint16_t target_is_finite(const fs_attitude_target *target)
{
    return (uint16_t)(quaternion_is_finite(&target->attitude) & fs_is_finite(target->thrust_n));
}

static uint16_t reference_is_finite(const fs_attitude_reference *reference)
{
    return (uint16_t)(quaternion_is_finite(&reference->attitude) & vector_is_finite(&reference->rates_frd_rad_s) &
                      vector_is_finite(&reference->acceleration_frd_rad_s2));
}

static uint16_t wrench_is_finite(const fs_wrench *wrench)
{
    return (uint16_t)(fs_is_finite(wrench->thrust_n) & vector_is_finite(&wrench->torque_frd_n_m));
}

void fs_loops_init(fs_loops *loops)
{
    const fs_vehicle_state level = {{FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)},
                                    {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)},
                                    {FS_LIT(1.0), FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)},
                                    {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)}};

    loops->rates.guidance = FS_GUIDANCE_LAWS; /* none yet: the first laws start without memory */
    loops->rates.position = FS_POSITION_LAWS;
    loops->rates.controller = FS_CONTROLLERS;
    loops->rates.mixing = FS_MIXER_LAWS;
    loops->setup.guidance = FS_LIT(0.0); /* a role with one law has no number of its index */
    loops->setup.position = FS_LIT(0.0);
    loops->setup.mixing = FS_LIT(0.0);
    fs_params_reset(loops);
    fs_loops_reset(loops, &level);
}

static void clear_last(fs_loops *loops)
{
    fs_loop_output *last = &loops->last;
    uint16_t i;

    last->reference.attitude.w = FS_LIT(0.0);
    last->reference.attitude.x = FS_LIT(0.0);
    last->reference.attitude.y = FS_LIT(0.0);
    last->reference.attitude.z = FS_LIT(0.0);
    last->reference.rates_frd_rad_s = no_vector;
    last->reference.acceleration_frd_rad_s2 = no_vector;
    last->wrench.thrust_n = FS_LIT(0.0);
    last->wrench.torque_frd_n_m = no_vector;
    last->wrench_achieved = last->wrench;
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        last->rotor_command_rad_s[i] = FS_LIT(0.0);
    }
    last->status = 0U;
    loops->saturation.thrust = FS_LIT(0.0);
    loops->saturation.torque = no_vector;
}

void fs_loops_reset_laws(fs_loops *loops)
{
    fs_guidance_laws_reset(&loops->guidance_memory);
    fs_position_laws_reset(&loops->position_memory);
    fs_controllers_reset(&loops->controller_memory);
    fs_mixer_laws_reset(&loops->mixing_memory);
}

void fs_loops_reset(fs_loops *loops, const fs_vehicle_state *state)
{
    const fs_quaternion *attitude = &state->attitude;

    loops->reference_memory.w = attitude->w;
    loops->reference_memory.x = attitude->x;
    loops->reference_memory.y = attitude->y;
    loops->reference_memory.z = attitude->z;
    loops->reference_memory.p_rad_s = FS_LIT(0.0);
    loops->reference_memory.q_rad_s = FS_LIT(0.0);
    loops->reference_memory.r_rad_s = FS_LIT(0.0);
    fs_loops_reset_laws(loops);
    loops->target.attitude = *attitude;
    loops->target.thrust_n = FS_LIT(0.0);
    loops->is_target_sound = target_is_finite(&loops->target);
    loops->last_target = loops->target;
    loops->fraction = FS_LIT(0.0);
    clear_last(loops);
    loops->last.attitude_target = loops->target;
}

/* From here the target moves from where it is to a new one, over an outer period. */
static void begin_outer_period(fs_loops *loops)
{
    loops->last_target = loops->target;
    loops->fraction = FS_LIT(0.0);
}

/* Run guidance and the position law, or keep their memories and the target as they were. */
static void outer_loop(fs_loops *loops, const fs_loop_input *input, uint16_t state_is_sound)
{
    const fs_loop_rates *rates = &loops->rates;
    fs_guidance_law_memory guidance;
    fs_position_law_memory position;
    fs_position_setpoint setpoint;
    fs_attitude_target target;
    uint16_t is_sound;

    if (!state_is_sound || !setpoint_is_sound(&input->setpoint)) {
        return;
    }
    is_sound = fs_guidance_laws_step(rates->guidance, &loops->guidance_memory, &input->state, &input->setpoint,
                                     &loops->guidance, rates->outer_dt_s, &guidance, &setpoint);
    is_sound &= setpoint_is_sound(&setpoint);
    is_sound &= fs_position_laws_step(rates->position, &loops->position_memory, &input->state, &setpoint,
                                      &loops->position, rates->outer_dt_s, loops->saturation.thrust, &position,
                                      &target);
    is_sound &= target_is_finite(&target);
    if (is_sound) {
        loops->guidance_memory = guidance;
        loops->position_memory = position;
        loops->target = target;
        loops->is_target_sound = 1U;
    }
}

/* Direction of a difference that the mixer could not follow: -1, 0 or +1. */
static fs_real direction(fs_real lag)
{
    return lag > FS_LIT(0.0) ? FS_LIT(1.0) : (lag < FS_LIT(0.0) ? FS_LIT(-1.0) : FS_LIT(0.0));
}

/* What the attitude law gets to know, from the reference in the vehicle's body frame. */
static void gather(const fs_loops *loops, const fs_vehicle_state *state, const fs_attitude_reference *reference,
                   fs_attitude_inputs *inputs)
{
    const fs_vector3 *lag = &loops->saturation.torque;
    const fs_quaternion inverse = fs_conjugate(&state->attitude);
    const fs_quaternion turn = fs_quaternion_product(&inverse, &reference->attitude);

    inputs->attitude = state->attitude;
    inputs->rates_frd_rad_s = state->rates_frd_rad_s;
    inputs->reference = *reference;
    inputs->error_rad = fs_rotation_vector(&turn);
    inputs->relative_rotor_speed_rad_s =
        fs_relative_rotor_speed(loops->last.rotor_command_rad_s, loops->mixer.spin, loops->mixer.rotors);
    inputs->saturation.x = direction(lag->x);
    inputs->saturation.y = direction(lag->y);
    inputs->saturation.z = direction(lag->z);
}

/* Reference filter and attitude controller, into tick and output. Nonzero: reference, torque and memory are finite. */
static uint16_t attitude_loop(const fs_loops *loops, const fs_vehicle_state *state, fs_tick *tick,
                              fs_loop_output *output)
{
    const fs_quaternion aim = fs_blend(&loops->last_target.attitude, &loops->target.attitude, loops->fraction);
    fs_attitude_reference filtered;
    fs_attitude_inputs inputs;
    uint16_t is_sound;

    fs_attitude_reference_step(&loops->reference_memory, &aim, &loops->reference, loops->rates.inner_dt_s,
                               &tick->reference, &filtered);
    output->reference = fs_in_body_frame(&filtered, &state->attitude);
    is_sound = (uint16_t)(reference_is_finite(&filtered) & reference_is_finite(&output->reference));
    gather(loops, state, &output->reference, &inputs);
    is_sound &= fs_controllers_step(loops->rates.controller, &loops->controller_memory, &inputs, &loops->controller,
                                    loops->rates.inner_dt_s, &tick->controller, &output->wrench.torque_frd_n_m);
    output->wrench.thrust_n = loops->target.thrust_n;
    return (uint16_t)(is_sound & wrench_is_finite(&output->wrench));
}

/* Share the wrench out to the rotors; those that the vehicle has not stand still. Nonzero: no sum overflowed. */
static uint16_t mix(const fs_loops *loops, fs_tick *tick, fs_loop_output *output)
{
    fs_real work[3][FS_MAX_ROTORS];
    const fs_wrench *achieved = &output->wrench_achieved;
    uint16_t i, is_sound;

    for (i = loops->rates.rotors; i < FS_MAX_ROTORS; i++) {
        output->rotor_command_rad_s[i] = FS_LIT(0.0);
    }
    is_sound = fs_mixer_laws_step(loops->rates.mixing, &loops->mixing_memory, &output->wrench, &loops->mixer,
                                  &loops->mixing, loops->rates.inner_dt_s, output->rotor_command_rad_s, work,
                                  &tick->mixing, &output->wrench_achieved);
    output->status = fs_saturation_of(&output->wrench, achieved, &loops->resolution, &tick->saturation);
    for (i = 0U; i < loops->rates.rotors; i++) {
        is_sound &= fs_is_finite(output->rotor_command_rad_s[i]);
    }
    return (uint16_t)(is_sound & wrench_is_finite(achieved));
}

/* Run inner loop and mixer; return 0 and keep the tick, or the status bit that tells why the output is not sound. */
static uint16_t inner_loop(fs_loops *loops, const fs_vehicle_state *state, uint16_t state_is_sound, fs_clock clock,
                           uint32_t began, fs_loop_output *output, fs_loop_cost *cost)
{
    uint16_t is_sound;
    uint32_t controlled;
    fs_tick tick;

    cost->inner = 0UL;
    cost->mixer = 0UL;
    if (!state_is_sound || !loops->is_target_sound) {
        return FS_STATUS_INPUT_NOT_FINITE;
    }
    is_sound = attitude_loop(loops, state, &tick, output);
    controlled = now(clock);
    cost->readings++;
    cost->inner = controlled - began;
    if (!is_sound) {
        return FS_STATUS_OUTPUT_NOT_FINITE;
    }
    is_sound = mix(loops, &tick, output);
    cost->mixer = now(clock) - controlled;
    cost->readings++;
    if (!is_sound) {
        return FS_STATUS_OUTPUT_NOT_FINITE;
    }
    output->attitude_target = loops->target;
    loops->reference_memory = tick.reference;
    loops->controller_memory = tick.controller;
    loops->mixing_memory = tick.mixing;
    loops->saturation = tick.saturation;
    loops->last = *output;
    return 0U;
}

void fs_loops_step(fs_loops *loops, const fs_loop_input *input, fs_clock clock, fs_loop_output *output,
                   fs_loop_cost *cost)
{
    const uint32_t began = now(clock);
    const uint16_t state_is_sound = state_is_finite(&input->state);
    uint32_t inner_began;
    uint16_t unsound;

    if ((input->flags & FS_RESET) != 0U) {
        fs_loops_reset(loops, &input->state);
    }
    if ((input->flags & FS_SET_TARGET) != 0U) {
        begin_outer_period(loops);
        loops->target = input->target;
        loops->is_target_sound = target_is_finite(&loops->target);
    }
    cost->outer = 0UL;
    cost->readings = 3U; /* at the start, here and at the end */
    inner_began = now(clock);
    if ((input->flags & FS_OUTER_DUE) != 0U) {
        const uint32_t outer_began = inner_began;
        begin_outer_period(loops);
        outer_loop(loops, input, state_is_sound);
        inner_began = now(clock);
        cost->outer = inner_began - outer_began;
        cost->readings++;
    }
    loops->fraction += loops->rates.fraction_step;
    unsound = inner_loop(loops, &input->state, state_is_sound, clock, inner_began, output, cost);
    if (unsound != 0U) {
        *output = loops->last;
        output->attitude_target = loops->target;
        output->status = unsound;
    }
    cost->whole = now(clock) - began;
}
