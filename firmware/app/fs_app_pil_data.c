#include "fs_app_pil_data.h"

#define STATE_SIZE 13U
#define SETPOINT_SIZE 11U
#define TARGET_SIZE 5U
#define REST_AT 7U /* place in FS_PIL_TICK.values of what follows attitude and rates */
#define SETPOINT_AT 13U
#define REFERENCE_SIZE 4U
#define KNOWN_FLAGS ((uint32_t)(FS_OUTER_DUE | FS_SET_TARGET | FS_RESET))
#define EXPONENT 0x7F800000UL /* all ones: infinite or not a number */

/* By their bits, because a C28x computes with NaN as with infinity. */
static uint16_t are_finite(const float *values, uint16_t count)
{
    uint16_t i, finite = 1U;

    for (i = 0U; i < count; i++) {
        if ((fs_float_bits(values[i]) & EXPONENT) == EXPONENT) {
            finite = 0U;
        }
    }
    return finite;
}

static uint16_t are_same(const float *some, const float *others, uint16_t count)
{
    uint16_t i, same = 1U;

    for (i = 0U; i < count; i++) {
        if (fs_float_bits(some[i]) != fs_float_bits(others[i])) {
            same = 0U;
        }
    }
    return same;
}

uint16_t fs_pil_is_same(const fs_pil_step *one, const fs_pil_step *other)
{
    return ((one->step == other->step) && (one->flags == other->flags) &&
            (are_same(one->state, other->state, STATE_SIZE) != 0U) &&
            (are_same(one->setpoint, other->setpoint, SETPOINT_SIZE) != 0U))
               ? 1U
               : 0U;
}

const char *fs_pil_fault_of(const fs_pil_step *step, uint16_t is_short)
{
    const uint32_t known = (is_short != 0U) ? (KNOWN_FLAGS | FS_PIL_WANT_REFERENCE) : KNOWN_FLAGS;
    const char *fault = NULL;
    uint16_t used = 0U; /* numbers of the setpoint */

    if ((step->flags & FS_OUTER_DUE) != 0UL) {
        used = SETPOINT_SIZE;
    } else if ((step->flags & FS_SET_TARGET) != 0UL) {
        used = TARGET_SIZE;
    } else {
        /* no setpoint */
    }
    if (((step->flags & ~known) != 0UL) ||
        ((step->flags & (FS_OUTER_DUE | FS_SET_TARGET)) == (FS_OUTER_DUE | FS_SET_TARGET))) {
        fault = "Step with unknown flags: rotors stopped";
    } else if (are_finite(step->state, STATE_SIZE) == 0U) {
        fault = "State is not finite: rotors stopped";
    } else if (are_finite(step->setpoint, used) == 0U) {
        fault = "Setpoint is not finite: rotors stopped";
    } else {
        /* sound */
    }
    return fault;
}

static fs_vector3 vector_at(const float *at)
{
    fs_vector3 vector;

    vector.x = (fs_real)at[0];
    vector.y = (fs_real)at[1];
    vector.z = (fs_real)at[2];
    return vector;
}

static fs_quaternion quaternion_at(const float *at)
{
    fs_quaternion quaternion;

    quaternion.w = (fs_real)at[0];
    quaternion.x = (fs_real)at[1];
    quaternion.y = (fs_real)at[2];
    quaternion.z = (fs_real)at[3];
    return quaternion;
}

void fs_pil_to_input(const fs_pil_step *step, fs_loop_input *input)
{
    input->state.position_ned_m = vector_at(&step->state[0]);
    input->state.velocity_ned_m_s = vector_at(&step->state[3]);
    input->state.attitude = quaternion_at(&step->state[6]);
    input->state.rates_frd_rad_s = vector_at(&step->state[10]);
    input->setpoint.position_ned_m = vector_at(&step->setpoint[0]);
    input->setpoint.velocity_ned_m_s = vector_at(&step->setpoint[3]);
    input->setpoint.acceleration_ned_m_s2 = vector_at(&step->setpoint[6]);
    input->setpoint.yaw_rad = (fs_real)step->setpoint[9];
    input->setpoint.yaw_rate_rad_s = (fs_real)step->setpoint[10];
    input->target.attitude = quaternion_at(&step->setpoint[0]);
    input->target.thrust_n = (fs_real)step->setpoint[4];
    input->flags = (uint16_t)step->flags;
}

static void put_vector(float *at, const fs_vector3 *vector)
{
    at[0] = (float)vector->x;
    at[1] = (float)vector->y;
    at[2] = (float)vector->z;
}

static void put_quaternion(float *at, const fs_quaternion *quaternion)
{
    at[0] = (float)quaternion->w;
    at[1] = (float)quaternion->x;
    at[2] = (float)quaternion->y;
    at[3] = (float)quaternion->z;
}

static void put_wrench(float *at, const fs_wrench *wrench)
{
    at[0] = (float)wrench->thrust_n;
    put_vector(&at[1], &wrench->torque_frd_n_m);
}

void fs_pil_to_report(const fs_loop_output *output, const fs_loop_cost *cost, fs_pil_report *report)
{
    uint16_t i;

    report->status = output->status;
    report->cycles[0] = cost->outer;
    report->cycles[1] = cost->inner;
    report->cycles[2] = cost->mixer;
    report->cycles[3] = cost->whole;
    put_quaternion(&report->attitude_target[0], &output->attitude_target.attitude);
    report->attitude_target[4] = (float)output->attitude_target.thrust_n;
    put_quaternion(&report->reference[0], &output->reference.attitude);
    put_vector(&report->reference[4], &output->reference.rates_frd_rad_s);
    put_vector(&report->reference[7], &output->reference.acceleration_frd_rad_s2);
    put_wrench(report->wrench, &output->wrench);
    put_wrench(report->wrench_achieved, &output->wrench_achieved);
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        report->rotor_command[i] = (float)output->rotor_command_rad_s[i];
    }
}

static void copy(float *to, const float *from, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        to[i] = from[i];
    }
}

void fs_pil_from_tick(const fs_pil_tick *tick, fs_pil_step *step)
{
    static const fs_pil_step blank = {0};

    *step = blank;
    step->step = tick->step;
    step->flags = tick->flags;
    copy(&step->state[6], tick->values, REST_AT);
    if ((tick->flags & FS_SET_TARGET) != 0UL) {
        copy(step->setpoint, &tick->values[REST_AT], TARGET_SIZE);
    } else {
        copy(step->state, &tick->values[REST_AT], SETPOINT_AT - REST_AT);
        copy(step->setpoint, &tick->values[SETPOINT_AT], SETPOINT_SIZE);
    }
}

void fs_pil_from_state(const fs_pil_state *state, fs_pil_step *step)
{
    step->step = state->time_us;
    step->flags = state->flags | (((state->flags & FS_SET_TARGET) != 0UL) ? 0U : FS_OUTER_DUE);
    copy(step->state, state->state, STATE_SIZE);
    copy(step->setpoint, state->setpoint, SETPOINT_SIZE);
}

void fs_pil_to_output(const fs_pil_report *report, uint32_t flags, uint16_t rotors, fs_pil_output *output)
{
    static const fs_pil_output blank = {0};
    uint16_t at = rotors;

    *output = blank;
    output->step = report->step;
    output->status = report->status;
    output->cycles = report->cycles[3];
    copy(output->values, report->rotor_command, rotors);
    if ((flags & FS_OUTER_DUE) != 0UL) {
        copy(&output->values[at], report->attitude_target, TARGET_SIZE);
        at = (uint16_t)(at + TARGET_SIZE);
    }
    if ((flags & FS_PIL_WANT_REFERENCE) != 0UL) {
        copy(&output->values[at], report->reference, REFERENCE_SIZE);
    }
}
