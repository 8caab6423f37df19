/* How much of the stack was ever used: it is painted at the start, and the paint that is left is counted. */
#ifndef F28_STACK_H
#define F28_STACK_H

#include "fs_wire.h"

/* from the linker command file: where the stack begins; it grows upwards */
extern volatile uint16_t f28_stack[];

/* Paint all but the first F28_STACK_MARGIN words; first thing in main, when no more than those are in use. */
void f28_stack_paint(void);

/* Words from the beginning up to the last one that lost its paint. */
uint32_t f28_stack_high_water(void);

#endif
