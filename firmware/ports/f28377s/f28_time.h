/* CPU timer 0 gives the milliseconds, CPU timer 1 runs freely and gives the cost of a step in processor cycles. */
#ifndef F28_TIME_H
#define F28_TIME_H

#include "fs_wire.h"

void f28_time_init(void);      /* before interrupts are enabled */
uint32_t f28_now_ms(void);     /* since the start, modulo 2^32 */
uint32_t f28_now_us(void);     /* the same, modulo 2^32; to be called at least every 21 s */
uint32_t f28_cycles(void);     /* of SYSCLK outside interrupts, counting up modulo 2^32: 21 s */

/* For interrupts: what f28_interrupt_begins returned goes to f28_interrupt_ends. Their entry and return still count. */
uint32_t f28_interrupt_begins(void);
void f28_interrupt_ends(uint32_t began);

#endif
