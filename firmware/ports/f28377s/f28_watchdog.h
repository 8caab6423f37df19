/* The hardware watchdog: it restarts the processor when the main loop or the timer interrupt has stopped for 105 ms. */
#ifndef F28_WATCHDOG_H
#define F28_WATCHDOG_H

#include "fs_wire.h"

/* Return 1 if a watchdog caused this start, and forget it. Before Device_init, which may use the watchdog itself. */
uint16_t f28_watchdog_was_cause(void);

void f28_watchdog_start(uint32_t now_ms);

/* From every pass of the main loop: serves the watchdog when the timer has counted on since the last time. */
void f28_watchdog_pass(uint32_t now_ms);

#endif
