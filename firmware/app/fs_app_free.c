/*
 * Free-running: the target runs its loops by its own timer, on the newest state that a host has sent.
 *
 * The outer loop is due in every so many ticks of the inner one, as FS_OUTER_DIV says. A flight begins with a state that has
 * RESET and ends with one that has REST. When states stop coming in between, the rotors stop: the safe state, until RESET.
 */
#include "fs_app_parts.h"
#include "fs_app_pil_data.h"
#include "fs_constants.h"

#define US_PER_S FS_LIT(1000000.0)
#define DEFAULT_TIMEOUT_US 100000UL
#define REFERENCE_SIZE 4U /* of the attitude */
#define TARGET_SIZE 5U
#define MOST_TICKS 1000.0F
#define MOST_TIMEOUT_MS 10000.0F
#define DRIVE_RESERVE (FS_OUTBOX_SIZE - 192U) /* at most two wait here, more in the port's ring */

static void begin_window(fs_app *app)
{
    static const fs_pil_timing blank = {0};

    app->free_run.timing = blank;
    app->free_run.aged = 0UL;
    app->free_run.window_ms = app->now_ms;
}

void fs_app_free_init(fs_app *app)
{
    static const fs_free blank = {0};

    app->free_run = blank;
    begin_window(app);
}

void fs_app_free_stop(fs_app *app)
{
    app->free_run.is_on = 0U;
    app->free_run.is_flying = 0U;
    if (app->state == FS_APP_FREE) {
        app->state = FS_APP_READY;
    }
}

static void begin_running(fs_app *app, uint16_t every, uint32_t timeout_us)
{
    fs_free *run = &app->free_run;

    run->is_on = 1U;
    run->is_flying = 0U;
    run->is_new = 0U;
    run->is_begun = 0U;
    run->every = every;
    run->ticks = 0U;
    run->timeout_us = timeout_us;
    app->kept = 0U;
    begin_window(app);
    if (fs_app_is_stopped(app) == 0U) {
        app->state = FS_APP_FREE;
    }
}

uint16_t fs_app_free_command(fs_app *app, float what, float every, float timeout_ms)
{
    uint16_t result = FS_MAV_RESULT_ACCEPTED;

    if (what == 0.0F) {
        fs_app_free_stop(app);
    } else if ((what != 1.0F) || !((every >= 1.0F) && (every <= MOST_TICKS)) ||
               !((timeout_ms >= 0.0F) && (timeout_ms <= MOST_TIMEOUT_MS))) {
        result = FS_MAV_RESULT_DENIED;
    } else if (app->free_run.has_time == 0U) {
        result = FS_MAV_RESULT_UNSUPPORTED;
    } else if ((app->state == FS_APP_STEPPING) || (app->free_run.is_flying != 0U)) {
        result = FS_MAV_RESULT_TEMPORARILY_REJECTED;
    } else {
        begin_running(app, (uint16_t)every, (timeout_ms >= 1.0F) ? ((uint32_t)timeout_ms * 1000UL) : DEFAULT_TIMEOUT_US);
    }
    return result;
}

static void stop_running(fs_app *app, const char *why)
{
    app->free_run.is_flying = 0U;
    if (app->state != FS_APP_SAFE) {
        app->state = FS_APP_SAFE;
        app->safe_states++;
        fs_app_raise_alarm(app, FS_MAV_SEVERITY_EMERGENCY, why);
    }
}

static void take_state(fs_app *app, const fs_pil_step *state)
{
    fs_free *run = &app->free_run;

    if ((state->flags & FS_RESET) != 0UL) {
        run->is_flying = 1U;
        run->is_reset = 1U;
        app->state = FS_APP_FREE;
    }
    if (run->is_new != 0U) {
        run->timing.skipped++;
    }
    run->state = *state;
    run->arrived_us = run->now_us;
    run->is_new = 1U;
}

/* A state is an FS_PIL_STEP whose number is the host's time; the target decides itself when the outer loop is due. */
void fs_app_on_state(fs_app *app)
{
    fs_pil_state message;
    fs_pil_step state;
    const char *fault;

    if (app->free_run.is_on == 0U) {
        return;
    }
    fs_pil_state_decode(app->frame.payload, app->frame.length, &message);
    fs_pil_from_state(&message, &state);
    fault = fs_pil_fault_of(&state, 0U);
    app->free_run.timing.states++;
    if ((message.flags & FS_PIL_REST) != 0UL) {
        app->free_run.is_flying = 0U;
    } else if ((app->free_run.is_flying == 0U) && ((message.flags & FS_RESET) == 0UL)) {
        /* nothing flies until RESET */
    } else if (fault != NULL) {
        app->free_run.state.step = state.step; /* the host tells by it which flight was refused */
        stop_running(app, fault);
    } else {
        take_state(app, &state);
    }
}

static void run_loops(fs_app *app, fs_pil_report *report)
{
    fs_free *run = &app->free_run;
    fs_loop_input input;
    fs_loop_output output;
    fs_loop_cost cost;

    if (run->is_reset != 0U) {
        run->phase = 0U;
    }
    fs_pil_to_input(&run->state, &input);
    input.flags = (run->is_reset != 0U) ? FS_RESET : 0U;
    if (run->phase == 0U) {
        input.flags |= ((run->state.flags & FS_SET_TARGET) != 0UL) ? FS_SET_TARGET : FS_OUTER_DUE;
    }
    run->is_reset = 0U;
    run->phase = (uint16_t)((run->phase + 1U) % (uint16_t)app->loops.setup.outer_divisor);
    fs_loops_step(&app->loops, &input, app->port->clock, &output, &cost);
    fs_app_take_overhead_out(app, &cost);
    fs_pil_to_report(&output, &cost, report);
    if (fs_app_is_overrun(app, &cost) != 0U) {
        report->status |= FS_APP_OVERRUN;
        run->timing.overruns++;
        app->loop_overruns++;
    }
    if (cost.whole > run->timing.cost_max) {
        run->timing.cost_max = cost.whole;
    }
}

/* A sum of a second's ages could exceed 32 bits. */
static void add_to_mean(float *mean, uint32_t value, uint32_t count)
{
    *mean += ((float)value - *mean) / (float)count;
}

static void note_age(fs_app *app, uint32_t age_us)
{
    fs_pil_timing *timing = &app->free_run.timing;

    app->free_run.aged++;
    add_to_mean(&timing->age_mean_us, age_us, app->free_run.aged);
    if (age_us > timing->age_max_us) {
        timing->age_max_us = age_us;
    }
    if (app->free_run.is_new == 0U) {
        timing->held++;
    }
    app->free_run.is_new = 0U;
}

static void send_drive(fs_app *app, const fs_pil_report *report, uint32_t age_us, uint32_t late_us)
{
    fs_pil_drive drive;
    uint16_t i;

    if (app->line.next != app->line.baud) { /* the line changes its rate as soon as the outbox is empty */
        return;
    }
    drive.state_time_us = app->free_run.state.step;
    drive.status = report->status;
    drive.age_us = age_us;
    drive.late_us = late_us;
    for (i = 0U; i < REFERENCE_SIZE; i++) {
        drive.reference[i] = report->reference[i];
    }
    for (i = 0U; i < TARGET_SIZE; i++) {
        drive.attitude_target[i] = report->attitude_target[i];
    }
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        drive.rotor_command[i] = report->rotor_command[i];
    }
    (void)fs_outbox_put(&app->outbox, FS_PIL_DRIVE_ID, app->payload, fs_pil_drive_encode(&drive, app->payload),
                        DRIVE_RESERVE);
}

static void tick(fs_app *app, uint32_t late_us)
{
    static const fs_pil_report blank = {0};
    fs_free *run = &app->free_run;
    fs_pil_report report = blank;
    const uint32_t age_us = run->now_us - run->arrived_us;

    run->timing.ticks++;
    add_to_mean(&run->timing.late_mean_us, late_us, run->timing.ticks);
    if (late_us > run->timing.late_max_us) {
        run->timing.late_max_us = late_us;
    }
    if ((run->is_flying != 0U) && (age_us > run->timeout_us)) {
        run->timing.timeouts++;
        stop_running(app, "No state in time: rotors stopped");
    }
    if (run->is_flying != 0U) {
        note_age(app, age_us);
        run_loops(app, &report);
    } else if (fs_app_is_stopped(app) != 0U) {
        report.status = FS_APP_BAD_INPUT;
    } else {
        /* at rest: all zero */
    }
    run->ticks++;
    if (run->ticks >= run->every) {
        run->ticks = 0U;
        send_drive(app, &report, age_us, late_us);
    }
}

static uint32_t period_us(const fs_app *app)
{
    const fs_real period = app->loops.rates.inner_dt_s * US_PER_S + FS_LIT(0.5);

    return (uint32_t)period;
}

void fs_app_run(fs_app *app, uint32_t now_us)
{
    fs_free *run = &app->free_run;
    uint32_t late_us, missed;

    if ((run->has_reading != 0U) && (now_us != run->now_us)) {
        run->has_time = 1U;
    }
    run->has_reading = 1U;
    run->now_us = now_us;
    if (run->is_on == 0U) {
        return;
    }
    if (run->is_begun == 0U) {
        run->is_begun = 1U;
        run->due_us = now_us;
    }
    late_us = now_us - run->due_us;
    if (late_us > 0x7FFFFFFFUL) { /* the next tick is not due */
        return;
    }
    missed = late_us / period_us(app);
    run->timing.missed += missed;
    run->due_us += (missed + 1U) * period_us(app);
    tick(app, late_us);
}

uint32_t fs_app_run_wait_us(const fs_app *app)
{
    uint32_t left_us = 0xFFFFFFFFUL;

    if (app->free_run.is_on != 0U) { /* what was due was done by the last fs_app_run */
        left_us = (app->free_run.is_begun != 0U) ? (app->free_run.due_us - app->free_run.now_us) : 0UL;
    }
    return left_us;
}

/* Once a period: the figures since the last time. Figures without room count in the next period. */
static void tell_timing(fs_app *app)
{
    fs_pil_timing *timing = &app->free_run.timing;

    timing->period_us = period_us(app);
    if (fs_outbox_put(&app->outbox, FS_PIL_TIMING_ID, app->payload, fs_pil_timing_encode(timing, app->payload),
                      FS_OUTBOX_ANSWER) != 0U) {
        begin_window(app);
    }
    app->free_run.window_ms = app->now_ms;
}

void fs_app_free_poll(fs_app *app)
{
    const fs_free *run = &app->free_run;

    if ((run->is_on != 0U) && (run->is_flying == 0U) &&
        ((app->now_ms - app->last_frame_ms) >= FS_APP_REST_TIMEOUT_MS)) {
        fs_app_free_stop(app); /* the host is gone */
    }
    if ((run->is_on != 0U) && ((app->now_ms - run->window_ms) >= FS_APP_PERIOD_MS)) {
        tell_timing(app);
    }
}
