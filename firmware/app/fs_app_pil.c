#include "fs_app_parts.h"
#include "fs_app_pil_data.h"
#include "fs_constants.h"

#define NANOSECONDS_PER_S FS_LIT(1000000000.0)

void fs_app_forget_flight(fs_app *app)
{
    fs_loops_init(&app->loops);
    app->expected = 0UL;
    app->kept = 0U;
    app->newest = 0U;
}

uint16_t fs_app_is_stopped(const fs_app *app)
{
    return ((app->state == FS_APP_SAFE) || (app->state == FS_APP_RESTARTED)) ? 1U : 0U;
}

/* A flight that begins as the last one did, but with other numbers, is another one: its first step is not a repeated one. */
void fs_app_on_new_numbers(fs_app *app)
{
    if ((app->kept != 0U) && ((app->answered[app->newest].step.flags & FS_RESET) != 0UL)) {
        app->kept = 0U;
    }
}

/* Send a report in the form that the step asked for; `flags` are the step's. */
static void send_report(fs_app *app, const fs_pil_report *report, uint32_t flags, uint16_t is_short)
{
    fs_pil_output output;

    if (is_short != 0U) {
        fs_pil_to_output(report, flags, app->loops.rates.rotors, &output);
        (void)fs_outbox_put(&app->outbox, FS_PIL_OUTPUT_ID, app->payload, fs_pil_output_encode(&output, app->payload),
                            FS_OUTBOX_REPORT);
    } else {
        (void)fs_outbox_put(&app->outbox, FS_PIL_REPORT_ID, app->payload, fs_pil_report_encode(report, app->payload),
                            FS_OUTBOX_REPORT);
    }
}

/* Report that nothing was computed: all zero, the rotors too. */
static void send_refusal(fs_app *app, uint32_t number, uint32_t status, uint16_t is_short)
{
    static const fs_pil_report blank = {0};
    fs_pil_report report = blank;

    report.step = number;
    report.status = status;
    send_report(app, &report, 0UL, is_short);
}

static uint32_t less(uint32_t cost, uint32_t overhead)
{
    return (cost > overhead) ? (cost - overhead) : 0UL;
}

/* Take the readings of the clock out of what it measured. */
void fs_app_take_overhead_out(const fs_app *app, fs_loop_cost *cost)
{
    cost->outer = less(cost->outer, app->clock_overhead);
    cost->inner = less(cost->inner, app->clock_overhead);
    cost->mixer = less(cost->mixer, app->clock_overhead);
    cost->whole = less(cost->whole, app->clock_overhead * ((uint32_t)cost->readings - 1U));
}

/* Tell whether a step took longer than a period of the inner loop, where the clock's rate is known. */
uint16_t fs_app_is_overrun(const fs_app *app, const fs_loop_cost *cost)
{
    fs_real clock_hz = FS_LIT(0.0);

    if (app->port->cost_unit == FS_COST_CYCLES) {
        clock_hz = (fs_real)app->port->clock_hz;
    } else if (app->port->cost_unit == FS_COST_NANOSECONDS) {
        clock_hz = NANOSECONDS_PER_S;
    } else {
        /* no time */
    }
    return ((clock_hz > FS_LIT(0.0)) && ((fs_real)cost->whole > clock_hz * app->loops.rates.inner_dt_s)) ? 1U : 0U;
}

/* The place for the next step of this flight, or the first one of another flight. */
static fs_answered *next_place(fs_app *app, uint16_t is_reset)
{
    if (is_reset != 0U) {
        app->kept = 0U;
    }
    if (app->kept < FS_APP_WINDOW) {
        app->kept++;
    }
    app->newest = (uint16_t)((app->newest + 1U) % FS_APP_WINDOW);
    return &app->answered[app->newest];
}

static void compute(fs_app *app, const fs_pil_step *step, uint16_t is_short)
{
    fs_answered *answered = next_place(app, ((step->flags & FS_RESET) != 0UL) ? 1U : 0U);
    fs_loop_input input;
    fs_loop_output output;
    fs_loop_cost cost;

    fs_pil_to_input(step, &input);
    fs_loops_step(&app->loops, &input, app->port->clock, &output, &cost);
    fs_app_take_overhead_out(app, &cost);
    answered->step = *step;
    answered->is_short = is_short;
    app->expected = step->step + 1UL;
    app->state = FS_APP_STEPPING;
    app->last_step_ms = app->now_ms;
    app->steps++;
    answered->report.step = step->step;
    fs_pil_to_report(&output, &cost, &answered->report);
    if (fs_app_is_overrun(app, &cost) != 0U) {
        answered->report.status |= FS_APP_OVERRUN;
        app->loop_overruns++;
    }
    send_report(app, &answered->report, step->flags, is_short);
    answered->report.status |= FS_APP_REPEATED; /* when it is sent again */
}

static void stop_rotors(fs_app *app, const fs_pil_step *step, uint16_t is_short, const char *fault)
{
    send_refusal(app, step->step, FS_APP_BAD_INPUT | FS_STATUS_INPUT_NOT_FINITE, is_short);
    if (app->state != FS_APP_SAFE) {
        app->state = FS_APP_SAFE;
        app->kept = 0U;
        app->safe_states++;
        fs_app_raise_alarm(app, FS_MAV_SEVERITY_EMERGENCY, fault);
    }
}

/*
 * Return the answer to a step that was computed before; NULL if it was not. All of a step is compared: another host may
 * begin with the same number. A step with RESET counts as computed while it is the last one: later it begins a flight.
 */
static const fs_answered *answer_to(const fs_app *app, const fs_pil_step *step, uint16_t is_short)
{
    const fs_answered *found = NULL, *answered;
    uint16_t age;

    for (age = 0U; age < app->kept; age++) {
        answered = &app->answered[(app->newest + FS_APP_WINDOW - age) % FS_APP_WINDOW];
        if (((age == 0U) || ((step->flags & FS_RESET) == 0UL)) && (answered->is_short == is_short) &&
            (fs_pil_is_same(step, &answered->step) != 0U)) {
            found = answered;
        }
    }
    return found;
}

static void take_step(fs_app *app, const fs_pil_step *step, uint16_t is_short)
{
    const fs_answered *before = answer_to(app, step, is_short);
    const char *fault = fs_pil_fault_of(step, is_short);
    uint16_t is_reset = ((step->flags & FS_RESET) != 0UL) ? 1U : 0U;

    if ((app->free_run.is_on != 0U) && (app->free_run.is_flying == 0U) && (is_reset != 0U)) {
        fs_app_free_stop(app); /* the host that started the free run is gone */
    }
    if (before != NULL) {
        app->repeats++;
        send_report(app, &before->report, step->flags, is_short);
    } else if ((app->state == FS_APP_SAFE) && (is_reset == 0U)) {
        send_refusal(app, step->step, FS_APP_BAD_INPUT, is_short);
    } else if ((app->free_run.is_on != 0U) ||
               ((is_reset == 0U) && ((app->state == FS_APP_RESTARTED) || (step->step != app->expected)))) {
        app->out_of_order++;
        send_refusal(app, app->expected, FS_APP_OUT_OF_ORDER, is_short);
    } else if (fault != NULL) {
        stop_rotors(app, step, is_short, fault);
    } else {
        compute(app, step, is_short);
    }
}

void fs_app_on_step(fs_app *app)
{
    fs_pil_step step;

    fs_pil_step_decode(app->frame.payload, app->frame.length, &step);
    take_step(app, &step, 0U);
}

void fs_app_on_tick(fs_app *app)
{
    fs_pil_tick tick;
    fs_pil_step step;

    fs_pil_tick_decode(app->frame.payload, app->frame.length, &tick);
    fs_pil_from_tick(&tick, &step);
    take_step(app, &step, 1U);
}
