#include "fs_app_parts.h"
#include "fs_constants.h"
#include "fs_params.h"

static void send_value(fs_app *app, uint16_t index)
{
    fs_param_value message;
    uint16_t length;

    fs_text_put(message.param_id, FS_PARAM_NAME_SIZE, fs_param_name(index));
    message.param_value = (float)fs_param_get(&app->loops, index);
    message.param_type = FS_MAV_PARAM_TYPE_REAL32;
    message.param_count = fs_param_count();
    message.param_index = index;
    length = fs_param_value_encode(&message, app->payload);
    (void)fs_outbox_put(&app->outbox, FS_PARAM_VALUE_ID, app->payload, length, FS_OUTBOX_ANSWER);
}

/* Refuse what the frame's sender asked about a parameter. */
static void send_error(fs_app *app, const fs_octet *name, int16_t index, uint16_t error)
{
    fs_param_error message;
    uint16_t length;

    message.target_system = app->frame.system;
    message.target_component = app->frame.component;
    fs_put_octets(message.param_id, name, FS_PARAM_NAME_SIZE);
    message.param_index = index;
    message.error = error;
    length = fs_param_error_encode(&message, app->payload);
    (void)fs_outbox_put(&app->outbox, FS_PARAM_ERROR_ID, app->payload, length, FS_OUTBOX_ANSWER);
}

/* Return the index of a name as it came; -1 when there is no such parameter. */
static int16_t find(const fs_octet *name)
{
    char text[FS_PARAM_NAME_SIZE + 1U];

    fs_text_get(name, FS_PARAM_NAME_SIZE, text);
    return fs_param_find(text);
}

void fs_app_on_param_list(fs_app *app)
{
    fs_param_request_list message;

    fs_param_request_list_decode(app->frame.payload, app->frame.length, &message);
    if (fs_app_is_target(message.target_system, message.target_component) != 0U) {
        app->next_listed = 0U;
    }
}

void fs_app_go_on_listing(fs_app *app)
{
    send_value(app, app->next_listed);
    app->next_listed++;
}

void fs_app_on_param_read(fs_app *app)
{
    fs_param_request_read message;
    int16_t index;

    fs_param_request_read_decode(app->frame.payload, app->frame.length, &message);
    if (fs_app_is_target(message.target_system, message.target_component) == 0U) {
        return;
    }
    index = (message.param_index < 0) ? find(message.param_id) : message.param_index;
    if ((index >= 0) && ((uint16_t)index < fs_param_count())) {
        send_value(app, (uint16_t)index);
    } else {
        send_error(app, message.param_id, message.param_index, FS_MAV_PARAM_ERROR_DOES_NOT_EXIST);
    }
}

/* Integers come as REAL32 too, or as another type with the number in the float (PARAM_ENCODE_C_CAST). */
void fs_app_on_param_set(fs_app *app)
{
    fs_param_set_message message;
    int16_t index;

    fs_param_set_message_decode(app->frame.payload, app->frame.length, &message);
    if (fs_app_is_target(message.target_system, message.target_component) == 0U) {
        return;
    }
    index = find(message.param_id);
    if (index < 0) {
        send_error(app, message.param_id, -1, FS_MAV_PARAM_ERROR_DOES_NOT_EXIST);
        return;
    }
    if (fs_param_set(&app->loops, (uint16_t)index, (fs_real)message.param_value) == FS_PARAM_DONE) {
        fs_app_on_new_numbers(app);
    } else {
        send_error(app, message.param_id, -1, FS_MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE);
    }
    send_value(app, (uint16_t)index); /* also after an error, which not every ground station knows */
}
