#include "f28_stack.h"

#include "f28_board.h"

#define PAINT 0xA5A5U

void f28_stack_paint(void)
{
    uint16_t at;

    for (at = F28_STACK_MARGIN; at < F28_STACK_WORDS; at++) {
        f28_stack[at] = PAINT;
    }
}

uint32_t f28_stack_high_water(void)
{
    uint16_t used = F28_STACK_WORDS;

    while (used > 0U && f28_stack[used - 1U] == PAINT) {
        used--;
    }
    return used;
}
