/*
 * The chip that the tests simulate below driverlib, register by register and cycle by cycle of SYSCLK: SCIA with its FIFOs,
 * CPU timers 0 and 1, the interrupt controller, the watchdog, pins. Driverlib is TI's where there is C2000Ware, otherwise
 * the part in own/. Every access to a register takes FAKE_ACCESS cycles, in which octets come and go and interrupts strike,
 * so the port is interrupted between any two of its accesses.
 */
#ifndef FAKE_H
#define FAKE_H

#include "driverlib.h"

#define FAKE_SYSCLK 200000000ULL
#define FAKE_ACCESS 10U

/* What the line brings: an octet in the low 8 bits, or with one of these. */
#define FAKE_FRAMING 0x100U /* the octet arrives, its stop bit is low */
#define FAKE_BREAK 0x200U   /* the line stays low after an octet that ended so: deaf until the software reset */
#define FAKE_PAUSE 0x400U   /* silence for the time of an octet */
#define FAKE_OVERRUN 0x800U /* the octet is lost before the FIFO, with the flag OE alone, as users report */

/*
 * A software reset in the midst of an octet loses it. The receiver then waits for the next low bit, takes it for a start
 * bit, and reads a false octet across the border to the next one; and so on, until a stop bit or a pause meets it in
 * step. In the start bit itself a reset costs nothing. An octet that is just being sent is damaged.
 */

/*
 * How a FIFO interrupt flag behaves, which TI's documents leave open. FAKE_LEVEL: it rises again as soon as it is
 * cleared while its condition holds. FAKE_EDGE: it rises only when the condition begins to hold. The port has to live
 * with both.
 */
#define FAKE_LEVEL 0U
#define FAKE_EDGE 1U

/*
 * A moment between two given accesses is hit by an interrupt once in hours. fake_strike_every makes that common: whatever
 * the FIFOs hold, those of SCIA's interrupts that the SCI has enabled strike at every n-th access of the main loop, or
 * wait there until they are unmasked.
 */
void fake_strike_every(uint32_t n); /* 0, as after power on: only when the chip has a reason */

/*
 * TI's manual says that the receiver stops after a break, and nothing of the kind of other errors. fake_stop_at_errors
 * makes it stop after an octet with a framing error too: the port has to come back from that.
 */
void fake_stop_at_errors(void);

void fake_power_on(uint16_t flags_are, uint32_t reset_cause, uint32_t timer1_begins_at);
void fake_run(uint32_t cycles); /* the processor is busy with something else; interrupts come through */
uint64_t fake_time(void);       /* cycles */
void fake_line(const uint16_t *octets, uint32_t count); /* append to what the line brings */
uint32_t fake_line_waits(void);                         /* of it, not yet brought */
uint32_t fake_sent(uint16_t *octets, uint32_t room);    /* take what left on the line */
uint64_t fake_octet_cycles(void);                       /* time of an octet on the line, as SCIA is set */
void fake_stop_timer0(void);
uint32_t fake_watchdog_bites(void);  /* how often the watchdog ran out */
uint32_t fake_watchdog_served(void);
uint32_t fake_pin(uint32_t pin);     /* last level written */
uint32_t fake_reset_cause(void);
uint32_t fake_interrupts(uint32_t number);
uint32_t fake_longest_masked(void);  /* cycles with interrupts off outside interrupts */
const char *fake_misuse(void);       /* the first thing that the real chip would not have liked, or "" */

#endif
