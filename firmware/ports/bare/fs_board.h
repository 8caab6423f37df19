/*
 * What a board gives to the main loop of fs_bare.c. Every function is called from the main loop alone, and returns at
 * once: none waits for the line. firmware/ports/template has an empty one of each.
 */
#ifndef FS_BOARD_H
#define FS_BOARD_H

#include "fs_wire.h"

/* Start clocks, pins, UART and timers, then enable interrupts if the board uses any. Called once. */
void fs_board_init(void);

/* Clock of the processor [Hz], as fs_board_init set it. The cost counter counts its cycles. */
uint32_t fs_board_clock_hz(void);

/* 1: the watchdog caused this start. Called once, after fs_board_init. */
uint16_t fs_board_was_watchdog(void);

/* Take the oldest received octet; 0 if there is none. */
uint16_t fs_board_receive(fs_octet *octet);

/* 1 if fs_board_send has room for an octet. */
uint16_t fs_board_can_send(void);

/* Send an octet; only while there is room. */
void fs_board_send(fs_octet octet);

/* Totals since the start, modulo 2^32: octets lost; octets damaged (framing, noise) and breaks. */
uint32_t fs_board_overruns(void);
uint32_t fs_board_errors(void);

/* Milliseconds since the start, counting up modulo 2^32. */
uint32_t fs_board_now_ms(void);

/* Cycles of the processor, counting up modulo 2^32. */
uint32_t fs_board_cycles(void);

/* Size of the stack, and the most of it that was ever used, in the smallest addressable unit; 0: not measured. */
uint32_t fs_board_stack_size(void);
uint32_t fs_board_stack_high_water(void);

/* Once per pass of the main loop: show the state (FS_APP_READY …) by a light, and service the watchdog. */
void fs_board_pass(uint32_t now_ms, uint16_t state);

#endif
