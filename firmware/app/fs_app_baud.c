/*
 * The baud rate of the line, changed at run time.
 *
 * A new rate begins when the acknowledgement has left, and is on trial until a frame arrives at it. Without one, and when
 * octets arrive for a while of which none is part of a frame, the line goes back: a host at another rate finds the target
 * within seconds. Silence changes nothing. A change that cannot begin within a second is dropped.
 */
#include "fs_app_parts.h"
#include "fs_constants.h"

#define SLOWEST 9600.0F /* the longest frame takes less than a third of FS_APP_BAUD_TRIAL_MS */
#define FASTEST 20000000.0F

void fs_app_baud_init(fs_app *app)
{
    app->line.baud = app->port->baud;
    app->line.next = app->port->baud;
    app->line.former = app->port->baud;
    app->line.is_on_trial = 0U;
    app->line.has_heard = 0U;
    app->line.is_unframed = 0U;
    app->line.since_ms = 0UL;
    app->line.unframed_ms = 0UL;
}

static void go_to(fs_app *app, uint32_t baud, uint32_t former)
{
    app->line.next = baud;
    app->line.former = former;
    app->line.since_ms = app->now_ms;
}

uint16_t fs_app_set_baud(fs_app *app, float baud)
{
    uint16_t result = FS_MAV_RESULT_ACCEPTED;

    if (app->port->can_set_baud == NULL) {
        result = FS_MAV_RESULT_UNSUPPORTED;
    } else if (!((baud >= SLOWEST) && (baud <= FASTEST)) || (app->port->can_set_baud((uint32_t)baud) == 0U)) {
        result = FS_MAV_RESULT_DENIED;
    } else if (app->line.next != app->line.baud) { /* a trial is none: this command is a frame, which ends it */
        result = FS_MAV_RESULT_TEMPORARILY_REJECTED;
    } else {
        go_to(app, (uint32_t)baud, app->line.baud);
    }
    return result;
}

void fs_app_baud_heard(fs_app *app)
{
    app->line.is_on_trial = 0U;
    app->line.has_heard = 1U;
}

/* Tell whether octets have arrived for FS_APP_BAUD_TRIAL_MS without a frame; a pause of that time begins anew. */
static uint16_t is_only_noise(fs_app *app)
{
    if (app->line.has_heard != 0U) {
        app->line.has_heard = 0U;
        app->line.is_unframed = 0U;
        return 0U;
    }
    if (app->has_received == 0U) {
        return 0U;
    }
    if ((app->line.is_unframed == 0U) || ((app->now_ms - app->last_octet_ms) >= FS_APP_BAUD_TRIAL_MS)) {
        app->line.is_unframed = 1U;
        app->line.unframed_ms = app->now_ms;
    }
    return ((app->now_ms - app->line.unframed_ms) >= FS_APP_BAUD_TRIAL_MS) ? 1U : 0U;
}

/* Go to the next rate as soon as everything has left at the present one. */
static void go_to_next(fs_app *app)
{
    if ((app->outbox.count == 0U) && (app->port->set_baud(app->line.next) != 0U)) {
        app->line.is_on_trial = (app->line.next != app->line.former) ? 1U : 0U;
        app->line.baud = app->line.next;
        app->line.is_unframed = 0U;
        app->line.since_ms = app->now_ms;
        if (app->line.is_on_trial == 0U) {
            (void)fs_app_send_text(app, FS_MAV_SEVERITY_NOTICE, "Baud rate: no frame came, back at the former one",
                                   FS_OUTBOX_NEWS);
        }
    }
}

void fs_app_baud_poll(fs_app *app)
{
    if (app->line.next != app->line.baud) {
        go_to_next(app);
        if ((app->now_ms - app->line.since_ms) >= FS_APP_BAUD_TRIAL_MS) {
            app->line.next = app->line.baud; /* the line was never free: a host that waits is gone by now */
        }
    } else if ((app->line.is_on_trial != 0U) && ((app->now_ms - app->line.since_ms) >= FS_APP_BAUD_TRIAL_MS)) {
        go_to(app, app->line.former, app->line.former);
    } else if ((app->line.baud != app->port->baud) && (is_only_noise(app) != 0U)) {
        go_to(app, app->port->baud, app->port->baud);
    } else {
        /* the rate is right, or the line is silent */
    }
}

uint32_t fs_app_baud_wait_ms(const fs_app *app)
{
    uint32_t wait_ms = FS_APP_PERIOD_MS;

    if (app->line.next != app->line.baud) {
        wait_ms = 1UL;
    } else if (app->line.is_on_trial != 0U) {
        wait_ms = FS_APP_BAUD_TRIAL_MS - (app->now_ms - app->line.since_ms);
    } else {
        /* nothing is due */
    }
    return wait_ms;
}
