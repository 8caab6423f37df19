/*
 * The application of a target: it runs the loops step by step for a host, and serves its parameters to ground stations.
 *
 * The application has neither interrupts nor hardware. A port gives it octets and the time, and takes octets from it, all
 * from one main loop:
 *
 *     for (;;) {
 *         while (octets have come)  { fs_app_receive(&app, octet); }
 *         fs_app_run(&app, now_us);
 *         fs_app_poll(&app, now_ms);
 *         count = fs_app_transmit(&app, octets, room);  ...send them
 *     }
 *
 * A step is computed inside fs_app_receive, when the last octet of its frame is given. A free-running target computes
 * inside fs_app_run, at its own time. Nothing flies without a host: a target has no sensors of its own, and it drives no
 * rotors.
 */
#ifndef FS_APP_H
#define FS_APP_H

#include "fs_loops.h"
#include "fs_messages.h"
#include "fs_outbox.h"
#include "fs_parser.h"

#define FS_APP_SYSTEM 1U /* MAVLink ids of the target on its own link */
#define FS_APP_COMPONENT 1U

/* Unit of the port's clock: FS_PIL_IDENTITY.cost_unit */
#define FS_COST_NONE 0U
#define FS_COST_CYCLES 1U
#define FS_COST_INSTRUCTIONS 2U
#define FS_COST_NANOSECONDS 3U

/* FS_PIL_STATUS.state */
#define FS_APP_READY 0U      /* no step for FS_APP_STEP_TIMEOUT_MS, or none yet */
#define FS_APP_STEPPING 1U   /* a host steps */
#define FS_APP_SAFE 2U       /* bad input came: rotors stopped until a step with RESET */
#define FS_APP_RESTARTED 3U  /* the watchdog restarted the target: parameters are lost; until a step with RESET */

#define FS_APP_FREE 4U       /* the loops run by the target's timer */

/* FS_PIL_REPORT.status, above the 16 bits of the loops */
#define FS_APP_REPEATED 0x10000UL
#define FS_APP_OUT_OF_ORDER 0x20000UL
#define FS_APP_OVERRUN 0x40000UL
#define FS_APP_BAD_INPUT 0x80000UL

/* FS_PIL_SENSE.kind; smaller numbers are those of the estimator's rings */
#define FS_SENSE_IMU 10UL
#define FS_SENSE_EARTH 11UL
#define FS_SENSE_LANDED 12UL
#define FS_SENSE_PARAMS 13UL
#define FS_SENSE_CLEAR 14UL
#define FS_SENSE_START 15UL
#define FS_SENSE_READ 16UL
#define FS_SENSE_ORIGIN 17UL

#define FS_APP_PROTOCOL 4U /* version of the FS_PIL messages: FS_PIL_IDENTITY.protocol */
#define FS_APP_WINDOW 8U   /* steps whose answers are kept, so that a host may send as many before the first answer */

#define FS_APP_STEP_TIMEOUT_MS 1000UL /* without a step: no host steps any more */
#define FS_APP_SILENCE_MS 20UL        /* without an octet: an incomplete frame is dropped */
#define FS_APP_REST_TIMEOUT_MS 5000UL /* free-running at rest without a frame: stop */
#define FS_APP_BAUD_TRIAL_MS 1000UL /* at a new baud rate without a frame: go back; also until a change must begin */
#define FS_APP_PERIOD_MS 1000UL       /* between heartbeats, between status messages, between complaints */

/* What the application has to know about where it runs; it stays the port's and must outlive the application. */
typedef struct {
    fs_clock clock;                    /* cost counter that counts up modulo 2^32, not in interrupts; NULL: none */
    uint32_t clock_hz;                 /* of the processor; 0: unknown or emulated */
    uint16_t cost_unit;                /* FS_COST_* */
    uint16_t was_watchdog;             /* 1: this start is the watchdog's doing */
    const char *board, *compiler;      /* see fs_build.h */
    const fs_octet *source_hash;       /* 8 octets */
    uint32_t stack_size;               /* in the smallest addressable unit */
    uint32_t (*stack_high_water)(void); /* most of it that was ever used; NULL: unknown */
    uint32_t baud;                      /* of the line at the start; 0: it has no rate */
    uint16_t (*can_set_baud)(uint32_t baud); /* 1: the line can run at this rate; NULL: the rate is fixed */
    uint16_t (*set_baud)(uint32_t baud);     /* change the rate; 0: not yet, octets are still being sent */
    uint16_t (*sense)(const fs_pil_sense *event, fs_pil_estimate *estimate); /* fs_sensing.h; NULL: no estimator */
    void (*read_estimator)(fs_pil_memory *words);
} fs_port;

/* The baud rate of the line; see fs_app_baud.c. */
typedef struct {
    uint32_t baud, next, former;     /* present one; another one if a change is due; the one to go back to */
    uint32_t since_ms, unframed_ms;  /* when it began or was commanded; when the first octet without a frame came */
    uint16_t is_on_trial, is_unframed, has_heard; /* the last: a frame, since the search for noise */
} fs_line;

/* A step and its report, for the case that the report is lost. */
typedef struct {
    fs_pil_step step;
    fs_pil_report report;
    uint16_t is_short; /* 1: it came as an FS_PIL_TICK, and is answered by an FS_PIL_OUTPUT */
} fs_answered;

/* The last event of the estimator, for the case that its answer is lost; see fs_app_sense.c. */
typedef struct {
    fs_pil_estimate answer;
    uint32_t kind;
    uint16_t has_answer;
} fs_sensed;

/* Free-running; see fs_app_free.c. */
typedef struct {
    uint16_t is_on, is_flying;
    uint16_t has_reading, has_time; /* fs_app_run was called; its microseconds have changed since */
    uint16_t is_begun; /* a deadline is set */
    uint16_t is_reset; /* the next tick resets the loops */
    uint16_t is_new;   /* no tick has used the state yet */
    uint16_t every, ticks, phase; /* ticks per FS_PIL_DRIVE, since the last one; since the outer loop was due */
    uint32_t now_us, due_us, arrived_us, timeout_us;
    fs_pil_step state; /* its number is the host's time */
    fs_pil_timing timing;
    uint32_t aged, window_ms; /* ticks with an age in this window; when it began */
} fs_free;

/* The state of the application: the caller owns it, and reads it only through fs_app_* functions. */
typedef struct {
    const fs_port *port;
    fs_loops loops;
    fs_parser parser;
    fs_frame frame;
    fs_outbox outbox;
    fs_octet payload[FS_MAX_PAYLOAD]; /* where a payload is made */

    uint32_t now_ms, last_octet_ms, last_frame_ms, last_step_ms, last_heartbeat_ms, last_status_ms, last_complaint_ms;
    uint32_t clock_overhead; /* cost of a clock reading; costs are told without it */
    uint16_t is_polled;    /* the three times of the last reports are valid */
    uint16_t has_received; /* octets since the last poll */
    uint16_t state;        /* FS_APP_READY … */

    uint32_t expected;    /* number of the next step */
    fs_answered answered[FS_APP_WINDOW]; /* a ring of the last steps of this flight */
    uint16_t kept, newest;               /* how many there are; place of the last one */
    uint32_t steps, repeats, out_of_order, loop_overruns, safe_states;

    fs_sensed sensed;
    fs_line line;
    fs_free free_run;
    uint32_t uart_overruns, uart_errors, told_overruns; /* the last: of those that were complained about */
    const char *alarm;                                  /* a text that waits for room in the outbox; NULL: none */
    uint16_t alarm_severity;
    uint16_t next_listed;                               /* index of the next parameter of a list; the count: no list */
} fs_app;

/* Measure the clock's overhead, and begin: parameters at their defaults, state READY (or RESTARTED), step 0 or one with RESET expected. */
void fs_app_init(fs_app *app, const fs_port *port);

/* Take an octet from the line; its high bits may be anything. Answers wait for fs_app_transmit. */
void fs_app_receive(fs_app *app, fs_octet octet);

/* Note what the serial port has lost since the start, as totals: octets overrun; framing, parity and break errors. */
void fs_app_uart_errors(fs_app *app, uint32_t overruns, uint32_t errors);

/* Run the tasks that are due by the port's time, which counts modulo 2^32: heartbeat, status, time-outs. */
void fs_app_poll(fs_app *app, uint32_t now_ms);

/* Free-running: note the port's time, which counts modulo 2^32, and run the tick that is due. From each pass. */
void fs_app_run(fs_app *app, uint32_t now_us);

/* Return in how many microseconds after the last fs_app_run a tick is due; 2^32 - 1 if none is. */
uint32_t fs_app_run_wait_us(const fs_app *app);

/* Return in how many milliseconds after the last fs_app_poll there is something due, if no octet comes before. */
uint32_t fs_app_wait_ms(const fs_app *app);

/*
 * Take at most `room` octets to be sent, clean of high bits; returns how many, 0 when there are none.
 * A list of parameters under way goes on whenever nothing else waits.
 */
uint16_t fs_app_transmit(fs_app *app, fs_octet *out, uint16_t room);

/* Return FS_APP_READY …, for lights. */
uint16_t fs_app_state(const fs_app *app);

#endif
