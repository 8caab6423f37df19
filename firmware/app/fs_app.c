#include "fs_app.h"

#include "fs_app_parts.h"
#include "fs_constants.h"
#include "fs_params.h"

#define CALIBRATIONS 16U

/* Least difference of two readings, one right after the other. */
static uint32_t overhead_of(fs_clock clock)
{
    uint32_t least = 0xFFFFFFFFUL;
    uint16_t i;

    if (clock == NULL) {
        return 0UL;
    }
    for (i = 0U; i < CALIBRATIONS; i++) {
        const uint32_t first = clock();
        const uint32_t between = clock() - first;

        if (between < least) {
            least = between;
        }
    }
    return least;
}

void fs_app_init(fs_app *app, const fs_port *port)
{
    app->port = port;
    app->clock_overhead = overhead_of(port->clock);
    fs_parser_init(&app->parser);
    fs_outbox_init(&app->outbox);
    app->now_ms = 0UL;
    app->last_octet_ms = 0UL;
    app->last_frame_ms = 0UL;
    app->last_step_ms = 0UL;
    app->last_heartbeat_ms = 0UL;
    app->last_status_ms = 0UL;
    app->last_complaint_ms = 0UL;
    app->is_polled = 0U;
    app->has_received = 0U;
    app->steps = 0UL;
    app->repeats = 0UL;
    app->out_of_order = 0UL;
    app->loop_overruns = 0UL;
    app->safe_states = 0UL;
    app->uart_overruns = 0UL;
    app->uart_errors = 0UL;
    app->told_overruns = 0UL;
    app->alarm = NULL;
    app->alarm_severity = 0U;
    app->next_listed = fs_param_count();
    app->sensed.kind = 0UL;
    app->sensed.has_answer = 0U;
    fs_app_baud_init(app);
    fs_app_free_init(app);
    fs_app_forget_flight(app);
    app->state = FS_APP_READY;
    if (port->was_watchdog != 0U) {
        app->state = FS_APP_RESTARTED;
        fs_app_raise_alarm(app, FS_MAV_SEVERITY_CRITICAL, "Restarted by the watchdog: parameters are lost");
    }
}

uint16_t fs_app_is_target(fs_octet system, fs_octet component)
{
    uint16_t is_system = ((system == 0U) || (system == FS_APP_SYSTEM)) ? 1U : 0U;
    uint16_t is_component = ((component == FS_MAV_COMP_ID_ALL) || (component == FS_APP_COMPONENT)) ? 1U : 0U;

    return ((is_system != 0U) && (is_component != 0U)) ? 1U : 0U;
}

static void handle(fs_app *app)
{
    app->last_frame_ms = app->now_ms;
    fs_app_baud_heard(app);
    switch (app->frame.id) {
    case FS_PIL_STEP_ID:
        fs_app_on_step(app);
        break;
    case FS_PIL_TICK_ID:
        fs_app_on_tick(app);
        break;
    case FS_PIL_STATE_ID:
        fs_app_on_state(app);
        break;
    case FS_PIL_SENSE_ID:
        fs_app_on_sense(app);
        break;
    case FS_PARAM_REQUEST_LIST_ID:
        fs_app_on_param_list(app);
        break;
    case FS_PARAM_REQUEST_READ_ID:
        fs_app_on_param_read(app);
        break;
    case FS_PARAM_SET_ID:
        fs_app_on_param_set(app);
        break;
    case FS_COMMAND_LONG_ID:
        fs_app_on_command(app);
        break;
    case FS_PING_ID:
        fs_app_on_ping(app);
        break;
    default: /* messages about other systems */
        break;
    }
}

void fs_app_receive(fs_app *app, fs_octet octet)
{
    uint16_t found = fs_parser_push(&app->parser, octet, &app->frame);

    app->has_received = 1U;
    while (found != 0U) { /* each time the parser holds less */
        handle(app);
        found = fs_parser_next(&app->parser, &app->frame);
    }
}

void fs_app_uart_errors(fs_app *app, uint32_t overruns, uint32_t errors)
{
    app->uart_overruns = overruns;
    app->uart_errors = errors;
}

/* A frame that lost octets must not hold back the next one: in lockstep both sides would wait for each other. */
static void listen_for_silence(fs_app *app)
{
    if (app->has_received != 0U) {
        app->has_received = 0U;
        app->last_octet_ms = app->now_ms;
    } else if ((app->parser.count > 0U) && ((app->now_ms - app->last_octet_ms) >= FS_APP_SILENCE_MS)) {
        while (fs_parser_flush(&app->parser, &app->frame) != 0U) {
            handle(app);
        }
    } else {
        /* nothing is held, or its rest may still come */
    }
}

/* Tell whether a period has passed since the last time, and begin the next one. */
static uint16_t is_due(const fs_app *app, uint32_t *last_ms)
{
    uint16_t due = ((app->is_polled == 0U) || ((app->now_ms - *last_ms) >= FS_APP_PERIOD_MS)) ? 1U : 0U;

    if (due != 0U) {
        *last_ms = app->now_ms;
    }
    return due;
}

static void tell_news(fs_app *app)
{
    fs_app_tell_alarm(app);
    if (is_due(app, &app->last_heartbeat_ms) != 0U) {
        (void)fs_app_send_heartbeat(app, (fs_app_is_stopped(app) != 0U) ? FS_OUTBOX_ALARM : FS_OUTBOX_NEWS);
    }
    if (is_due(app, &app->last_status_ms) != 0U) {
        (void)fs_app_send_status(app, FS_OUTBOX_NEWS);
    }
    if ((app->uart_overruns != app->told_overruns) && (is_due(app, &app->last_complaint_ms) != 0U)) {
        app->told_overruns = app->uart_overruns;
        (void)fs_app_send_text(app, FS_MAV_SEVERITY_WARNING, "Serial port overrun: octets were lost", FS_OUTBOX_NEWS);
    }
}

void fs_app_poll(fs_app *app, uint32_t now_ms)
{
    app->now_ms = now_ms;
    fs_app_baud_poll(app);
    listen_for_silence(app);
    if ((app->state == FS_APP_STEPPING) && ((now_ms - app->last_step_ms) >= FS_APP_STEP_TIMEOUT_MS)) {
        app->state = FS_APP_READY; /* nothing is forgotten: the host may go on */
    }
    tell_news(app);
    fs_app_free_poll(app);
    app->is_polled = 1U;
}

/* Lower *wait_ms to the rest of a period. */
static void wait_at_most(const fs_app *app, uint32_t since_ms, uint32_t period_ms, uint32_t *wait_ms)
{
    uint32_t left_ms = period_ms - (app->now_ms - since_ms); /* overdue tasks ran in the last fs_app_poll */

    if (left_ms < *wait_ms) {
        *wait_ms = left_ms;
    }
}

uint32_t fs_app_wait_ms(const fs_app *app)
{
    uint32_t wait_ms = (app->is_polled != 0U) ? FS_APP_PERIOD_MS : 0UL;

    wait_at_most(app, app->last_heartbeat_ms, FS_APP_PERIOD_MS, &wait_ms);
    wait_at_most(app, app->last_status_ms, FS_APP_PERIOD_MS, &wait_ms);
    if (app->parser.count > 0U) {
        wait_at_most(app, (app->has_received != 0U) ? app->now_ms : app->last_octet_ms, FS_APP_SILENCE_MS, &wait_ms);
    }
    if (app->state == FS_APP_STEPPING) {
        wait_at_most(app, app->last_step_ms, FS_APP_STEP_TIMEOUT_MS, &wait_ms);
    }
    wait_at_most(app, app->now_ms, fs_app_baud_wait_ms(app), &wait_ms);
    if (app->alarm != NULL) { /* the outbox may have room soon */
        wait_at_most(app, app->now_ms, FS_APP_SILENCE_MS, &wait_ms);
    }
    return wait_ms;
}

uint16_t fs_app_transmit(fs_app *app, fs_octet *out, uint16_t room)
{
    uint16_t count = fs_outbox_take(&app->outbox, out, room);

    /* nothing else waits when room is left, so a list never delays a report by more than one of its entries */
    while ((count < room) && (app->next_listed < fs_param_count())) {
        fs_app_go_on_listing(app);
        count = (uint16_t)(count + fs_outbox_take(&app->outbox, &out[count], (uint16_t)(room - count)));
    }
    return count;
}

uint16_t fs_app_state(const fs_app *app)
{
    return app->state;
}
