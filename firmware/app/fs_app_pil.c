#include "fs_app_parts.h"
#include "fs_app_pil_data.h"
#include "fs_constants.h"

#define NANOSECONDS_PER_S FS_LIT(1000000000.0)

void fs_app_forget_flight(fs_app *app)
{
    fs_loops_init(&app->loops);
    app->expected = 0UL;
    app->has_stepped = 0U;
}

uint16_t fs_app_is_stopped(const fs_app *app)
{
    return ((app->state == FS_APP_SAFE) || (app->state == FS_APP_RESTARTED)) ? 1U : 0U;
}

/* A flight that begins as the last one did, but with other numbers, is another one: its first step is not a repeated one. */
void fs_app_on_new_numbers(fs_app *app)
{
    if ((app->has_stepped != 0U) && ((app->step.flags & FS_RESET) != 0UL)) {
        app->has_stepped = 0U;
    }
}

static void send_report(fs_app *app, const fs_pil_report *report)
{
    uint16_t length = fs_pil_report_encode(report, app->payload);

    (void)fs_outbox_put(&app->outbox, FS_PIL_REPORT_ID, app->payload, length, FS_OUTBOX_REPORT);
}

/* Report that nothing was computed: all zero, the rotors too. */
static void send_refusal(fs_app *app, uint32_t number, uint32_t status)
{
    static const fs_pil_report blank = {0};
    fs_pil_report report = blank;

    report.step = number;
    report.status = status;
    send_report(app, &report);
}

/* Tell whether a step took longer than a period of the inner loop, where the clock's rate is known. */
static uint16_t is_overrun(const fs_app *app, const fs_loop_cost *cost)
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

static void compute(fs_app *app, const fs_pil_step *step)
{
    fs_loop_input input;
    fs_loop_output output;
    fs_loop_cost cost;

    fs_pil_to_input(step, &input);
    fs_loops_step(&app->loops, &input, app->port->clock, &output, &cost);
    app->step = *step;
    app->has_stepped = 1U;
    app->expected = step->step + 1UL;
    app->state = FS_APP_STEPPING;
    app->last_step_ms = app->now_ms;
    app->steps++;
    app->report.step = step->step;
    fs_pil_to_report(&output, &cost, &app->report);
    if (is_overrun(app, &cost) != 0U) {
        app->report.status |= FS_APP_OVERRUN;
        app->loop_overruns++;
    }
    send_report(app, &app->report);
    app->report.status |= FS_APP_REPEATED; /* when it is sent again */
}

static void stop_rotors(fs_app *app, const fs_pil_step *step, const char *fault)
{
    send_refusal(app, step->step, FS_APP_BAD_INPUT | FS_STATUS_INPUT_NOT_FINITE);
    if (app->state != FS_APP_SAFE) {
        app->state = FS_APP_SAFE;
        app->has_stepped = 0U;
        app->safe_states++;
        fs_app_raise_alarm(app, FS_MAV_SEVERITY_EMERGENCY, fault);
    }
}

void fs_app_on_step(fs_app *app)
{
    fs_pil_step step;
    uint16_t is_reset;
    const char *fault;

    fs_pil_step_decode(app->frame.payload, app->frame.length, &step);
    fault = fs_pil_fault_of(&step);
    is_reset = ((step.flags & FS_RESET) != 0UL) ? 1U : 0U;
    /* all of a step is compared: another host may begin with the same number */
    if ((app->has_stepped != 0U) && (fs_pil_is_same(&step, &app->step) != 0U)) {
        app->repeats++;
        send_report(app, &app->report);
    } else if ((app->state == FS_APP_SAFE) && (is_reset == 0U)) {
        send_refusal(app, step.step, FS_APP_BAD_INPUT);
    } else if ((is_reset == 0U) && ((app->state == FS_APP_RESTARTED) || (step.step != app->expected))) {
        app->out_of_order++;
        send_refusal(app, app->expected, FS_APP_OUT_OF_ORDER);
    } else if (fault != NULL) {
        stop_rotors(app, &step, fault);
    } else {
        compute(app, &step);
    }
}
