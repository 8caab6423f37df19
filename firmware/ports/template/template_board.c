/*
 * A board's functions, empty: copy this file, rename it after the board, and fill in each function. fs_board.h has their
 * contract. Delete nothing: the main loop calls all of them. docs/how-to/port.md goes through the steps.
 */
#include "fs_board.h"
#include "fs_ring.h"

#define RING 1024U /* octets, a power of two */

static volatile fs_octet received_octets[RING];
static fs_ring received;
static volatile uint32_t overruns, errors, milliseconds;

/* The three functions that interrupts call: name them in the vector table, or delete those that the board does not use. */
void template_received(void);
void template_millisecond(void);
void template_fault(void);

/* UART, receive interrupt: take every octet that has arrived. */
void template_received(void)
{
    const fs_octet octet = 0U; /* TODO read the data register; count framing and noise errors in `errors` */

    if (fs_ring_put(&received, octet) == 0U) {
        overruns = overruns + 1U;
    }
}

/* Timer, every millisecond. */
void template_millisecond(void)
{
    milliseconds = milliseconds + 1U;
}

/* Any fault: stand still, so that the watchdog restarts the processor. */
void template_fault(void)
{
    for (;;) {
    }
}

void fs_board_init(void)
{
    fs_ring_init(&received, received_octets, RING);
    overruns = 0U;
    errors = 0U;
    milliseconds = 0U;
    /* TODO 1. Clock: crystal, PLL, flash wait states. */
    /* TODO 2. Pins of the UART and of a light. */
    /* TODO 3. UART: 8N1, receive interrupt. Within 2 % of the baud rate, which gcs pil takes as 115200 by default. */
    /* TODO 4. A timer that interrupts every millisecond, and a counter of the processor's cycles. */
    /* TODO 5. Watchdog: 100 ms are enough; the longest pass takes the time of one step. */
    /* TODO 6. Interrupts on. */
}

uint32_t fs_board_clock_hz(void)
{
    return 100000000U; /* TODO of the processor, with which fs_board_cycles counts */
}

uint16_t fs_board_was_watchdog(void)
{
    return 0U; /* TODO read the cause of the reset, then clear it */
}

uint16_t fs_board_receive(fs_octet *octet)
{
    return fs_ring_take(&received, octet);
}

uint16_t fs_board_can_send(void)
{
    return 0U; /* TODO 1 while the transmit register, or its FIFO, has room */
}

void fs_board_send(fs_octet octet)
{
    (void)octet; /* TODO write it to the transmit register */
}

uint32_t fs_board_overruns(void)
{
    return overruns;
}

uint32_t fs_board_errors(void)
{
    return errors;
}

uint32_t fs_board_now_ms(void)
{
    return milliseconds; /* a 16-bit processor reads it twice, until both are the same */
}

uint32_t fs_board_cycles(void)
{
    return 0U; /* TODO counts up; complement a counter that counts down */
}

uint32_t fs_board_stack_size(void)
{
    return 0U; /* TODO fs_stack_size() of ports/gnu, or 0 if the stack is not painted */
}

uint32_t fs_board_stack_high_water(void)
{
    return 0U; /* TODO fs_stack_high_water() */
}

void fs_board_pass(uint32_t now_ms, uint16_t state)
{
    (void)now_ms; /* TODO light: on and off every 512 ms, for example */
    (void)state;  /* TODO a second light in FS_APP_SAFE, if the board has one */
    /* TODO service the watchdog, only when now_ms has changed: then a stopped timer restarts the processor too */
}
