/* How much of the stack was ever used: it is painted at the start, and the paint that is left is counted. */
#ifndef F28_STACK_H
#define F28_STACK_H

#include "fs_wire.h"

/* from the linker command file: where the stack begins; it grows upwards */
extern volatile uint16_t f28_stack[];

/*
 * Paint the free part: from F28_STACK_MARGIN words above `top`, a local variable of main, to the end. The pointer
 * leaves its variable, which C does not promise to work; on a C28x, with its one flat stack, it does. Nothing is
 * painted when `top` lies elsewhere.
 */
void f28_stack_paint(volatile uint16_t *top);

/* Words from the beginning up to the last one that lost its paint. */
uint32_t f28_stack_high_water(void);

#endif
