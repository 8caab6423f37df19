#include "steps.h"

#define FNV_START 2166136261UL
#define FNV_PRIME 16777619UL
#define PARAM_SET_ID 23U
#define NAME_ROOM 17U

void steps_init(steps *s, fs_clock clock)
{
    const fs_loop_cost nothing = {0U, 0U, 0U, 0U};

    s->clock = clock;
    s->most = nothing;
    s->sum = nothing;
    fs_loops_init(&s->loops);
    fs_parser_init(&s->parser);
    s->steps = 0U;
    s->refused = 0U;
    s->hash = FNV_START;
}

static fs_vector3 vector(const float *at)
{
    const fs_vector3 v = {at[0], at[1], at[2]};

    return v;
}

static fs_quaternion quaternion(const float *at)
{
    const fs_quaternion q = {at[0], at[1], at[2], at[3]};

    return q;
}

static void put_vector(float *at, fs_vector3 v)
{
    at[0] = v.x;
    at[1] = v.y;
    at[2] = v.z;
}

static void put_quaternion(float *at, fs_quaternion q)
{
    at[0] = q.w;
    at[1] = q.x;
    at[2] = q.y;
    at[3] = q.z;
}

static void read_input(const fs_pil_step *step, fs_loop_input *input)
{
    input->state.position_ned_m = vector(&step->state[0]);
    input->state.velocity_ned_m_s = vector(&step->state[3]);
    input->state.attitude = quaternion(&step->state[6]);
    input->state.rates_frd_rad_s = vector(&step->state[10]);
    input->setpoint.position_ned_m = vector(&step->setpoint[0]);
    input->setpoint.velocity_ned_m_s = vector(&step->setpoint[3]);
    input->setpoint.acceleration_ned_m_s2 = vector(&step->setpoint[6]);
    input->setpoint.yaw_rad = step->setpoint[9];
    input->setpoint.yaw_rate_rad_s = step->setpoint[10];
    input->target.attitude = quaternion(&step->setpoint[0]);
    input->target.thrust_n = step->setpoint[4];
    input->flags = (uint16_t)(step->flags & 7U);
}

static void write_report(const fs_loop_output *output, fs_pil_report *report)
{
    uint16_t i;

    put_quaternion(&report->attitude_target[0], output->attitude_target.attitude);
    report->attitude_target[4] = output->attitude_target.thrust_n;
    put_quaternion(&report->reference[0], output->reference.attitude);
    put_vector(&report->reference[4], output->reference.rates_frd_rad_s);
    put_vector(&report->reference[7], output->reference.acceleration_frd_rad_s2);
    report->wrench[0] = output->wrench.thrust_n;
    put_vector(&report->wrench[1], output->wrench.torque_frd_n_m);
    report->wrench_achieved[0] = output->wrench_achieved.thrust_n;
    put_vector(&report->wrench_achieved[1], output->wrench_achieved.torque_frd_n_m);
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        report->rotor_command[i] = output->rotor_command_rad_s[i];
    }
    report->cycles[0] = report->cycles[1] = report->cycles[2] = report->cycles[3] = 0U;
    report->status = output->status;
}

static void account(uint32_t *most, uint32_t *sum, uint32_t cost)
{
    if (cost > *most) {
        *most = cost;
    }
    *sum += cost;
}

static uint16_t answer(steps *s)
{
    uint16_t size;
    uint16_t i;

    fs_pil_step_decode(s->frame.payload, s->frame.length, &s->step);
    read_input(&s->step, &s->input);
    fs_loops_step(&s->loops, &s->input, s->clock, &s->output, &s->cost);
    account(&s->most.outer, &s->sum.outer, s->cost.outer);
    account(&s->most.inner, &s->sum.inner, s->cost.inner);
    account(&s->most.mixer, &s->sum.mixer, s->cost.mixer);
    account(&s->most.whole, &s->sum.whole, s->cost.whole);
    write_report(&s->output, &s->report);
    s->report.step = s->step.step;
    size = fs_pil_report_encode(&s->report, s->payload);
    size = fs_frame_encode(s->out, FS_PIL_REPORT_ID, (uint16_t)(s->steps & 0xFFU), 1U, 1U, s->payload, size);
    for (i = 0U; i < size; i++) {
        s->hash = (s->hash ^ (s->out[i] & 0xFFU)) * FNV_PRIME;
    }
    s->steps++;
    return size;
}

/* fields of PARAM_SET: value at 0, system and component at 4 and 5, name from 6 on */
static void set_parameter(steps *s)
{
    fs_octet octets[NAME_ROOM - 1U];
    char name[NAME_ROOM];

    fs_get_octets(s->frame.payload, s->frame.length, 6U, octets, NAME_ROOM - 1U);
    fs_text_get(octets, NAME_ROOM - 1U, name);
    if (steps_set(&s->loops, name, fs_get_float(s->frame.payload, s->frame.length, 0U)) != 0U) {
        s->refused++;
    }
}

uint16_t steps_push(steps *s, fs_octet octet)
{
    if (fs_parser_push(&s->parser, octet, &s->frame) == 0U) {
        return 0U;
    }
    if (s->frame.id == FS_PIL_STEP_ID) {
        return answer(s);
    }
    if (s->frame.id == PARAM_SET_ID) {
        set_parameter(s);
    }
    return 0U;
}
