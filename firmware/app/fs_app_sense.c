/* FS_PIL_SENSE: events of the estimator, each computed once. */
#include "fs_app_parts.h"

#define LAST_WORD 65535.0F /* that can be asked for */

static void send_estimate(fs_app *app, const fs_pil_estimate *estimate)
{
    (void)fs_outbox_put(&app->outbox, FS_PIL_ESTIMATE_ID, app->payload, fs_pil_estimate_encode(estimate, app->payload),
                        FS_OUTBOX_REPORT);
}

/* Answer that nothing was computed. */
static void refuse_event(fs_app *app, uint32_t number, uint32_t status)
{
    static const fs_pil_estimate blank = {0};
    fs_pil_estimate estimate = blank;

    estimate.event = number;
    estimate.status = status;
    send_estimate(app, &estimate);
}

static void send_words(fs_app *app, const fs_pil_sense *event)
{
    fs_pil_memory words;

    words.event = event->event;
    words.first = ((event->values[0] >= 0.0F) && (event->values[0] <= LAST_WORD)) ? (uint32_t)event->values[0] : 0UL;
    app->port->read_estimator(&words);
    (void)fs_outbox_put(&app->outbox, FS_PIL_MEMORY_ID, app->payload, fs_pil_memory_encode(&words, app->payload),
                        FS_OUTBOX_REPORT);
}

static void compute_event(fs_app *app, const fs_pil_sense *event)
{
    static const fs_pil_estimate blank = {0};
    fs_pil_estimate *const answer = &app->sensed.answer;
    const fs_clock clock = app->port->clock;
    const uint32_t before = (clock != NULL) ? clock() : 0UL;
    uint32_t cost;

    *answer = blank;
    answer->event = event->event;
    answer->status = (app->port->sense(event, answer) != 0U) ? 0UL : FS_APP_BAD_INPUT;
    cost = (clock != NULL) ? (clock() - before) : 0UL;
    answer->cycles = (cost > app->clock_overhead) ? (cost - app->clock_overhead) : 0UL;
    app->sensed.kind = event->kind;
    app->sensed.has_answer = 1U;
    send_estimate(app, answer);
    answer->status |= FS_APP_REPEATED; /* when it is sent again */
}

void fs_app_on_sense(fs_app *app)
{
    fs_pil_sense event;
    const fs_pil_estimate *const last = &app->sensed.answer;

    fs_pil_sense_decode(app->frame.payload, app->frame.length, &event);
    if (app->port->sense == NULL) {
        refuse_event(app, event.event, FS_APP_BAD_INPUT);
    } else if (event.kind == FS_SENSE_READ) {
        send_words(app, &event);
    } else if ((app->sensed.has_answer != 0U) && (event.event == last->event) && (event.kind == app->sensed.kind)) {
        send_estimate(app, last);
    } else if ((event.kind != FS_SENSE_CLEAR) &&
               ((app->sensed.has_answer == 0U) || (event.event != (last->event + 1UL)))) {
        refuse_event(app, (app->sensed.has_answer != 0U) ? (last->event + 1UL) : 0UL, FS_APP_OUT_OF_ORDER);
    } else {
        compute_event(app, &event);
    }
}
