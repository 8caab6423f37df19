#include "fs_app_parts.h"
#include "fs_constants.h"

#define MAVLINK_VERSION 3U
#define TEXT_SIZE 50U
#define ALARM_ROOM 96U /* octets: a text's frame has 66 at most, a heartbeat's 21 */

static uint16_t system_status(uint16_t state)
{
    uint16_t status = FS_MAV_STATE_STANDBY;

    if ((state == FS_APP_STEPPING) || (state == FS_APP_FREE)) {
        status = FS_MAV_STATE_ACTIVE;
    } else if (state == FS_APP_SAFE) {
        status = FS_MAV_STATE_EMERGENCY;
    } else if (state == FS_APP_RESTARTED) {
        status = FS_MAV_STATE_CRITICAL;
    } else {
        /* ready */
    }
    return status;
}

uint16_t fs_app_send_heartbeat(fs_app *app, uint16_t reserve)
{
    fs_heartbeat message;
    uint16_t length;

    message.type = FS_MAV_TYPE_QUADROTOR;
    message.autopilot = FS_MAV_AUTOPILOT_GENERIC;
    message.base_mode = FS_MAV_MODE_FLAG_HIL_ENABLED; /* never armed: it drives no rotors */
    message.custom_mode = 0UL;
    message.system_status = system_status(app->state);
    message.mavlink_version = MAVLINK_VERSION;
    length = fs_heartbeat_encode(&message, app->payload);
    return fs_outbox_put(&app->outbox, FS_HEARTBEAT_ID, app->payload, length, reserve);
}

uint16_t fs_app_send_status(fs_app *app, uint16_t reserve)
{
    fs_pil_status message;
    uint16_t length;

    message.time_boot_ms = app->now_ms;
    message.steps = app->steps;
    message.repeats = app->repeats;
    message.out_of_order = app->out_of_order;
    message.frames = app->parser.good;
    message.bad_frames = app->parser.bad + app->parser.unknown;
    message.skipped_octets = app->parser.skipped;
    message.uart_overruns = app->uart_overruns;
    message.uart_errors = app->uart_errors;
    message.dropped_frames = app->outbox.dropped;
    message.loop_overruns = app->loop_overruns;
    message.safe_states = app->safe_states;
    message.stack_size = app->port->stack_size;
    message.stack_high_water = (app->port->stack_high_water != NULL) ? app->port->stack_high_water() : 0UL;
    message.state = app->state;
    message.time_us = app->free_run.now_us;
    length = fs_pil_status_encode(&message, app->payload);
    return fs_outbox_put(&app->outbox, FS_PIL_STATUS_ID, app->payload, length, reserve);
}

uint16_t fs_app_send_text(fs_app *app, uint16_t severity, const char *text, uint16_t reserve)
{
    fs_statustext message;
    uint16_t length;

    message.severity = severity;
    fs_text_put(message.text, TEXT_SIZE, text);
    message.id = 0U;
    message.chunk_seq = 0U;
    length = fs_statustext_encode(&message, app->payload);
    return fs_outbox_put(&app->outbox, FS_STATUSTEXT_ID, app->payload, length, reserve);
}

void fs_app_raise_alarm(fs_app *app, uint16_t severity, const char *text)
{
    app->alarm = text;
    app->alarm_severity = severity;
    fs_app_tell_alarm(app);
}

void fs_app_tell_alarm(fs_app *app)
{
    if ((app->alarm != NULL) && (fs_outbox_room(&app->outbox) >= ALARM_ROOM)) {
        (void)fs_app_send_text(app, app->alarm_severity, app->alarm, FS_OUTBOX_ALARM);
        (void)fs_app_send_heartbeat(app, FS_OUTBOX_ALARM);
        app->alarm = NULL;
    }
}
