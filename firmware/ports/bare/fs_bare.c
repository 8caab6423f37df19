#include "fs_bare.h"

#include "fs_app.h"
#include "fs_board.h"
#include "fs_build.h"

#ifndef FS_BOARD
#define FS_BOARD "board without a name" /* 24 characters of it are told, by FS_PIL_IDENTITY */
#endif

#define MOST_OCTETS 64U /* of each direction in one pass */

static const fs_octet source_hash[8] = {FS_SOURCE_HASH};
static fs_port port;
static fs_app app;

void fs_bare_start(void)
{
    fs_board_init();
    port.clock = &fs_board_cycles;
    port.clock_hz = fs_board_clock_hz();
    port.cost_unit = FS_COST_CYCLES;
    port.was_watchdog = fs_board_was_watchdog();
    port.board = FS_BOARD;
    port.compiler = FS_COMPILER;
    port.source_hash = source_hash;
    port.stack_size = fs_board_stack_size();
    port.stack_high_water = &fs_board_stack_high_water;
    fs_app_init(&app, &port);
}

static void receive(void)
{
    fs_octet octet;
    uint16_t n;

    for (n = 0U; n < MOST_OCTETS; n++) {
        if (fs_board_receive(&octet) == 0U) {
            break;
        }
        fs_app_receive(&app, octet);
    }
}

static void transmit(void)
{
    fs_octet octet;
    uint16_t n;

    for (n = 0U; n < MOST_OCTETS; n++) {
        if ((fs_board_can_send() == 0U) || (fs_app_transmit(&app, &octet, 1U) == 0U)) {
            break;
        }
        fs_board_send(octet);
    }
}

void fs_bare_pass(void)
{
    const uint32_t now_ms = fs_board_now_ms();

#ifdef FS_STOP_AFTER_MS /* to see the watchdog bite */
    while (now_ms >= FS_STOP_AFTER_MS) {
    }
#endif
    receive();
    fs_app_uart_errors(&app, fs_board_overruns(), fs_board_errors());
    fs_app_poll(&app, now_ms);
    transmit();
    fs_board_pass(now_ms, fs_app_state(&app));
}
