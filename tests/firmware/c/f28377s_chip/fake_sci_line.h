/* The line at SCIA: what it brings, bit by bit where a software reset leads the receiver astray, and what was sent. */
#ifndef FAKE_SCI_LINE_H
#define FAKE_SCI_LINE_H

#include "fake_chip.h"

void fake_sci_receive(uint16_t what); /* an octet as the receiver reads it, a break or an overrun */

uint64_t fake_line_next(uint64_t most);
void fake_line_pass(void);
void fake_line_send(uint16_t octet);
void fake_line_cut(void);     /* a software reset: it may hit the octet that is on the line */
void fake_line_in_step(void); /* the receiver has stopped: it finds the next start bit */
void fake_line_power_on(void);

#endif
