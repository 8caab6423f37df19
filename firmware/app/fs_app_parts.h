/* The parts of the application, for its own files. Each takes a frame that is known to be of its kind. */
#ifndef FS_APP_PARTS_H
#define FS_APP_PARTS_H

#include "fs_app.h"

/* Tell whether a message with these targets is for this target; 0 is everybody. */
uint16_t fs_app_is_target(fs_octet system, fs_octet component);

/* Tell whether no step is taken until one with RESET: in the safe state, and after a restart by the watchdog. */
uint16_t fs_app_is_stopped(const fs_app *app);

/*
 * fs_app_news.c: what a target says by itself. When less than `reserve` octets would stay free in the outbox, a message
 * is dropped and counted, and 0 returned.
 */
uint16_t fs_app_send_heartbeat(fs_app *app, uint16_t reserve);
uint16_t fs_app_send_status(fs_app *app, uint16_t reserve);
uint16_t fs_app_send_text(fs_app *app, uint16_t severity, const char *text, uint16_t reserve);

/*
 * An alarm is a text with a heartbeat behind it, which need no reserve. It waits until both have room; of two that wait
 * the newer one is told. The text must last.
 */
void fs_app_raise_alarm(fs_app *app, uint16_t severity, const char *text);
void fs_app_tell_alarm(fs_app *app); /* if there is one, and room */

/* fs_app_pil.c: steps of the loops */
void fs_app_on_step(fs_app *app);
void fs_app_on_tick(fs_app *app);
void fs_app_on_new_numbers(fs_app *app);
void fs_app_forget_flight(fs_app *app); /* step 0 or one with RESET is expected next; the state stays */

uint16_t fs_app_is_overrun(const fs_app *app, const fs_loop_cost *cost);
void fs_app_take_overhead_out(const fs_app *app, fs_loop_cost *cost); /* the readings of the clock */

/* fs_app_sense.c: the estimator */
void fs_app_on_sense(fs_app *app);

/* fs_app_free.c */
void fs_app_free_init(fs_app *app);
uint16_t fs_app_free_command(fs_app *app, float what, float every, float timeout_ms);
void fs_app_free_stop(fs_app *app);
void fs_app_on_state(fs_app *app);
void fs_app_free_poll(fs_app *app); /* tell figures; end at rest without a host */

/* fs_app_params.c */
void fs_app_on_param_list(fs_app *app);
void fs_app_on_param_read(fs_app *app);
void fs_app_on_param_set(fs_app *app);
void fs_app_go_on_listing(fs_app *app); /* put the next parameter of a list under way */

/* fs_app_baud.c */
void fs_app_baud_init(fs_app *app);
uint16_t fs_app_set_baud(fs_app *app, float baud); /* returns the result to acknowledge */
void fs_app_baud_heard(fs_app *app);               /* a frame arrived */
void fs_app_baud_poll(fs_app *app);                /* before silence is noted */
uint32_t fs_app_baud_wait_ms(const fs_app *app);

/* fs_app_commands.c */
void fs_app_on_command(fs_app *app);
void fs_app_on_ping(fs_app *app);

#endif
