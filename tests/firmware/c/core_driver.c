/* Runs each part of the core over many samples, for tests that compare it with Python's. */
#include <string.h>

#include "fs_attitude_backstepping.h"
#include "fs_attitude_pid.h"
#include "fs_attitude_reference.h"
#include "fs_geometry.h"
#include "fs_loops.h"
#include "fs_math.h"
#include "fs_mixer_limits.h"
#include "fs_params.h"
#include "fs_position_pid.h"
#include "fs_rate_groups.h"

#define ROW 31

uint32_t drive_sizes(uint32_t which)
{
    const uint32_t sizes[4] = {(uint32_t)sizeof(fs_real), (uint32_t)sizeof(fs_loops), (uint32_t)sizeof(fs_loop_output),
                               (uint32_t)sizeof(fs_mixer)};
    return sizes[which];
}

void drive_math(uint32_t count, const fs_real *y, const fs_real *x, fs_real *sine, fs_real *cosine, fs_real *angle)
{
    for (uint32_t i = 0; i < count; i++) {
        const fs_quaternion q = {x[i], y[i], 0, 0};
        fs_sin_cos(x[i], &sine[i], &cosine[i]);
        angle[i] = fs_rotation_vector(&q).x;
    }
}

void drive_rotations(uint32_t count, const fs_quaternion *turned, const fs_vector3 *rates, const fs_real *dt_s,
                     fs_vector3 *vector, fs_quaternion *rotation)
{
    for (uint32_t i = 0; i < count; i++) {
        vector[i] = fs_rotation_vector(&turned[i]);
        rotation[i] = fs_rotation_over(&rates[i], dt_s[i]);
    }
}

void drive_position(uint32_t count, fs_position_memory *memory, const fs_vehicle_state *state,
                    const fs_position_setpoint *setpoint, const fs_position_params *params, const fs_real *dt_s,
                    const fs_real *saturation, fs_attitude_target *target)
{
    for (uint32_t i = 0; i < count; i++) {
        const fs_position_memory before = memory[i];
        fs_position_pid_step(&before, &state[i], &setpoint[i], &params[i], dt_s[i], saturation[i], &memory[i], &target[i]);
    }
}

void drive_reference(uint32_t count, fs_reference_memory *memory, const fs_quaternion *from, const fs_quaternion *to,
                     const fs_real *fraction, const fs_reference_params *params, const fs_real *dt_s,
                     const fs_quaternion *attitude, fs_attitude_reference *reference, fs_vector3 *error)
{
    for (uint32_t i = 0; i < count; i++) {
        const fs_quaternion target = fs_blend(&from[i], &to[i], fraction[i]);
        const fs_quaternion inverse = fs_conjugate(&attitude[i]);
        const fs_reference_memory before = memory[i];
        fs_attitude_reference filtered;
        fs_quaternion turn;
        fs_attitude_reference_step(&before, &target, &params[i], dt_s[i], &memory[i], &filtered);
        reference[i] = fs_in_body_frame(&filtered, &attitude[i]);
        turn = fs_quaternion_product(&inverse, &reference[i].attitude);
        error[i] = fs_rotation_vector(&turn);
    }
}

void drive_pid(uint32_t count, fs_pid_memory *memory, const fs_attitude_inputs *inputs, const fs_pid_params *params,
               const fs_real *dt_s, fs_vector3 *torque)
{
    for (uint32_t i = 0; i < count; i++) {
        const fs_pid_memory before = memory[i];
        fs_attitude_pid_step(&before, &inputs[i], &params[i], dt_s[i], &memory[i], &torque[i]);
    }
}

void drive_backstepping(uint32_t count, const fs_attitude_inputs *inputs, const fs_backstepping_params *params,
                        fs_vector3 *torque)
{
    for (uint32_t i = 0; i < count; i++) {
        const fs_backstepping_memory before = {0};
        fs_backstepping_memory after;
        fs_attitude_backstepping_step(&before, &inputs[i], &params[i], 0, &after, &torque[i]);
    }
}

void drive_mixer(uint32_t count, const fs_wrench *wrench, fs_mixer *mixer, uint32_t rotors, fs_real *speeds,
                 fs_wrench *achieved, fs_saturation *saturation, fs_real *relative)
{
    fs_resolution resolution;
    fs_mixer_derive(mixer, (uint16_t)rotors, &resolution); /* after what the test has filled in */
    for (uint32_t i = 0; i < count; i++) {
        fs_real *speed = &speeds[i * FS_MAX_ROTORS], work[3][FS_MAX_ROTORS];
        for (uint32_t rotor = rotors; rotor < FS_MAX_ROTORS; rotor++) {
            speed[rotor] = 0;
        }
        achieved[i] = fs_mix(&wrench[i], mixer, speed, work);
        (void)fs_saturation_of(&wrench[i], &achieved[i], &resolution, &saturation[i]);
        relative[i] = fs_relative_rotor_speed(speed, mixer->spin, mixer->rotors);
    }
}

/* Which of its short ways a mixer may go: 1 effectiveness undoes allocation, 2 rotors are alike. */
uint32_t drive_mixer_ways(const fs_mixer *mixer)
{
    return (mixer->is_inverse != 0 ? 1U : 0U) + (mixer->is_even != 0 ? 2U : 0U);
}

static void put_vector(fs_real *at, const fs_vector3 *v)
{
    at[0] = v->x;
    at[1] = v->y;
    at[2] = v->z;
}

static void put_quaternion(fs_real *at, const fs_quaternion *q)
{
    at[0] = q->w;
    at[1] = q->x;
    at[2] = q->y;
    at[3] = q->z;
}

static void put_output(fs_real *at, const fs_loop_output *output)
{
    put_quaternion(at, &output->attitude_target.attitude);
    at[4] = output->attitude_target.thrust_n;
    put_quaternion(at + 5, &output->reference.attitude);
    put_vector(at + 9, &output->reference.rates_frd_rad_s);
    put_vector(at + 12, &output->reference.acceleration_frd_rad_s2);
    at[15] = output->wrench.thrust_n;
    put_vector(at + 16, &output->wrench.torque_frd_n_m);
    at[19] = output->wrench_achieved.thrust_n;
    put_vector(at + 20, &output->wrench_achieved.torque_frd_n_m);
    for (uint32_t i = 0; i < FS_MAX_ROTORS; i++) {
        at[23 + i] = output->rotor_command_rad_s[i];
    }
}

static uint32_t ticks;

static uint32_t ticking_clock(void)
{
    ticks += 10U;
    return ticks;
}

/* costs: five for each step, counted by a clock that moves ten at every look, from where clock_at stands; NULL for no clock. */
void drive_loops(fs_loops *loops, uint32_t count, const fs_vehicle_state *state, const fs_position_setpoint *setpoint,
                 const fs_attitude_target *target, const uint16_t *flags, fs_real *rows, uint16_t *status,
                 uint32_t *costs, uint32_t clock_at)
{
    ticks = clock_at;
    for (uint32_t i = 0; i < count; i++) {
        fs_loop_input input;
        fs_loop_output output;
        fs_loop_cost cost;
        memset(&output, 0x5A, sizeof output);
        memset(&cost, 0x5A, sizeof cost);
        input.state = state[i];
        input.setpoint = setpoint[i];
        input.target = target[i];
        input.flags = flags[i];
        fs_loops_step(loops, &input, costs != NULL ? ticking_clock : NULL, &output, &cost);
        put_output(&rows[i * ROW], &output);
        status[i] = output.status;
        if (costs != NULL) {
            costs[5 * i] = cost.outer;
            costs[5 * i + 1] = cost.inner;
            costs[5 * i + 2] = cost.mixer;
            costs[5 * i + 3] = cost.whole;
            costs[5 * i + 4] = cost.readings;
        } else {
            status[i] = (uint16_t)(status[i] | (cost.outer | cost.inner | cost.mixer | cost.whole)); /* must be zero */
        }
    }
}

/* Fill with rubbish, so that nothing relies on zeroed memory. */
void drive_init(fs_loops *loops)
{
    memset(loops, 0x5A, sizeof *loops);
    fs_loops_init(loops);
}

uint32_t drive_set(fs_loops *loops, uint32_t index, fs_real value)
{
    return fs_param_set(loops, (uint16_t)index, value);
}

fs_real drive_get(const fs_loops *loops, uint32_t index)
{
    return fs_param_get(loops, (uint16_t)index);
}

fs_real drive_integral(const fs_loops *loops, uint32_t axis)
{
    const fs_real integrals[3] = {loops->controller_memory.pid.roll, loops->controller_memory.pid.pitch, loops->controller_memory.pid.yaw};
    return integrals[axis];
}

void drive_set_integral(fs_loops *loops, fs_real value)
{
    loops->controller_memory.pid.roll = value;
    loops->controller_memory.pid.pitch = value;
    loops->controller_memory.pid.yaw = value;
}

/* Write which of the ticks the outer loop is due in. */
void drive_rate_groups(uint32_t divisor, uint32_t count, uint16_t *due)
{
    fs_rate_groups groups;
    memset(&groups, 0x5A, sizeof groups);
    fs_rate_groups_init(&groups, (uint16_t)divisor);
    for (uint32_t i = 0; i < count; i++) {
        due[i] = fs_rate_groups_tick(&groups);
    }
}
