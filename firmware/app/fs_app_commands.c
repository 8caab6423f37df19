#include "fs_app_parts.h"
#include "fs_constants.h"

#include <limits.h>

#ifdef FS_DOUBLE
#define REAL_OCTETS 8U
#else
#define REAL_OCTETS 4U
#endif
#define HASH_SIZE 8U
#define BOARD_SIZE 24U
#define COMPILER_SIZE 48U
#define LAST_MESSAGE_ID 16777215.0F /* ids have 24 bits */
#define REBOOT 1.0F

static uint16_t send_identity(fs_app *app)
{
    fs_pil_identity message;
    uint16_t length;

    message.clock_hz = app->port->clock_hz;
    fs_put_octets(message.source_hash, app->port->source_hash, HASH_SIZE);
    message.cost_unit = app->port->cost_unit;
    message.real_octets = REAL_OCTETS;
    message.char_bits = CHAR_BIT;
    fs_text_put(message.board, BOARD_SIZE, app->port->board);
    fs_text_put(message.compiler, COMPILER_SIZE, app->port->compiler);
    message.compiler[COMPILER_SIZE - 1U] = 0U; /* a truncated version still ends with NUL */
    message.protocol = FS_APP_PROTOCOL;
    message.window = FS_APP_WINDOW;
    message.baud = app->line.baud;
    message.clock_overhead = app->clock_overhead;
    length = fs_pil_identity_encode(&message, app->payload);
    return fs_outbox_put(&app->outbox, FS_PIL_IDENTITY_ID, app->payload, length, FS_OUTBOX_ANSWER);
}

static uint16_t send_version(fs_app *app)
{
    static const fs_autopilot_version blank = {0};
    fs_autopilot_version message = blank;
    uint16_t length;

    message.capabilities.low = FS_MAV_PROTOCOL_CAPABILITY_MAVLINK2 | FS_MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST;
    fs_put_octets(message.flight_custom_version, app->port->source_hash, HASH_SIZE);
    length = fs_autopilot_version_encode(&message, app->payload);
    return fs_outbox_put(&app->outbox, FS_AUTOPILOT_VERSION_ID, app->payload, length, FS_OUTBOX_ANSWER);
}

/* Send the message of this id; returns the result to acknowledge. */
static uint16_t request_message(fs_app *app, float id)
{
    uint16_t result = FS_MAV_RESULT_ACCEPTED, is_sent = 1U;

    if (!((id >= 0.0F) && (id <= LAST_MESSAGE_ID))) { /* also when it is NaN */
        return FS_MAV_RESULT_DENIED;
    }
    switch ((uint32_t)id) {
    case FS_HEARTBEAT_ID:
        is_sent = fs_app_send_heartbeat(app, FS_OUTBOX_ANSWER);
        break;
    case FS_AUTOPILOT_VERSION_ID:
        is_sent = send_version(app);
        break;
    case FS_PIL_STATUS_ID:
        is_sent = fs_app_send_status(app, FS_OUTBOX_ANSWER);
        break;
    case FS_PIL_IDENTITY_ID:
        is_sent = send_identity(app);
        break;
    default:
        result = FS_MAV_RESULT_UNSUPPORTED;
        break;
    }
    if (is_sent == 0U) { /* there was no room: the client asks again */
        result = FS_MAV_RESULT_TEMPORARILY_REJECTED;
    }
    return result;
}

static void tell_reboot(fs_app *app)
{
    if (fs_app_is_stopped(app) != 0U) {
        fs_app_raise_alarm(app, FS_MAV_SEVERITY_CRITICAL, "Parameters at defaults; stopped until RESET");
    } else {
        (void)fs_app_send_text(app, FS_MAV_SEVERITY_NOTICE, "Loops restarted: parameters at their defaults",
                               FS_OUTBOX_ANSWER);
    }
}

/*
 * Begin anew as after power-up, but for the counters: parameters at their defaults, no flight. A target that was
 * stopped stays so: only a host that sends RESET starts it again.
 */
static uint16_t reboot(fs_app *app, float what)
{
    uint16_t result = FS_MAV_RESULT_ACCEPTED;

    if (what != REBOOT) {
        result = FS_MAV_RESULT_DENIED; /* there is nothing else to reboot, and nothing to shut down */
    } else if ((app->state == FS_APP_STEPPING) || (app->free_run.is_on != 0U)) {
        result = FS_MAV_RESULT_TEMPORARILY_REJECTED;
    } else {
        fs_app_forget_flight(app);
        tell_reboot(app);
    }
    return result;
}

static void acknowledge(fs_app *app, uint16_t command, uint16_t result)
{
    fs_command_ack message;
    uint16_t length;

    message.command = command;
    message.result = result;
    message.progress = 0U;
    message.result_param2 = 0L;
    message.target_system = app->frame.system;
    message.target_component = app->frame.component;
    length = fs_command_ack_encode(&message, app->payload);
    (void)fs_outbox_put(&app->outbox, FS_COMMAND_ACK_ID, app->payload, length, FS_OUTBOX_ANSWER);
}

void fs_app_on_command(fs_app *app)
{
    fs_command_long message;
    uint16_t result = FS_MAV_RESULT_UNSUPPORTED;

    fs_command_long_decode(app->frame.payload, app->frame.length, &message);
    if (fs_app_is_target(message.target_system, message.target_component) == 0U) {
        return;
    }
    if (message.command == FS_MAV_CMD_REQUEST_MESSAGE) {
        result = request_message(app, message.param1);
    } else if (message.command == FS_MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN) {
        result = reboot(app, message.param1);
    } else if (message.command == FS_MAV_CMD_FS_SET_BAUD_RATE) {
        result = fs_app_set_baud(app, message.param1);
    } else if (message.command == FS_MAV_CMD_FS_FREE_RUN) {
        result = fs_app_free_command(app, message.param1, message.param2, message.param3);
    } else {
        /* no other command */
    }
    acknowledge(app, message.command, result);
}

void fs_app_on_ping(fs_app *app)
{
    fs_ping message;
    uint16_t length;

    fs_ping_decode(app->frame.payload, app->frame.length, &message);
    if ((message.target_system != 0U) || (message.target_component != 0U)) {
        return; /* an answer, not a question */
    }
    message.target_system = app->frame.system;
    message.target_component = app->frame.component;
    length = fs_ping_encode(&message, app->payload);
    (void)fs_outbox_put(&app->outbox, FS_PING_ID, app->payload, length, FS_OUTBOX_ANSWER);
}
