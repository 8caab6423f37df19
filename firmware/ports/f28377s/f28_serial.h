/*
 * SCIA (GPIO 84 out, 85 in; F28379D: 42 out, 43 in: the USB bridge of the LaunchPad) through its FIFOs, interrupts and two rings. 8N1.
 *
 * The receive interrupt comes with every 8th octet: a burst costs little, and the time of 8 octets is left for it.
 * What lies below that level in the FIFO is fetched by the main loop, since the SCI has no interrupt for a line that
 * fell silent. A damaged octet is counted and kept: the checksum of its frame detects it. Breaks are dealt with by the
 * main loop, lest a line held low keep the processor in its interrupt. Sending goes on in the transmit interrupt for as long as there is something in the ring.
 *
 * After f28_serial_init all of it is for the main loop, with interrupts enabled.
 */
#ifndef F28_SERIAL_H
#define F28_SERIAL_H

#include "fs_wire.h"

void f28_serial_init(void); /* before interrupts are enabled */

/* From every pass of the main loop: fetch what no interrupt brought, and bring the receiver back after a break. */
void f28_serial_service(void);

/* Take at most `room` received octets; returns how many. */
uint16_t f28_serial_take(fs_octet *out, uint16_t room);

/* Return how many octets f28_serial_give has room for. */
uint16_t f28_serial_room(void);

/* Queue octets to be sent; returns how many were taken, the first ones, which is all while there is room. */
uint16_t f28_serial_give(const fs_octet *octets, uint16_t count);

/* Return 1 if the SCI makes this rate within 2 %. */
uint16_t f28_serial_can_set_baud(uint32_t baud);

/* Change the rate; return 0 and change nothing until the last octet was sent. To be called until it returns 1. */
uint16_t f28_serial_set_baud(uint32_t baud);

/* Totals since the start, modulo 2^32. */
uint32_t f28_serial_overruns(void); /* octets lost because the ring was full, and times when the hardware told a loss */
uint32_t f28_serial_errors(void);   /* octets with a framing error (parity has none here), and breaks */

#endif
