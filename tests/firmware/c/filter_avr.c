/* The estimator on an AVR; the link to the simulator is that of steps_avr.c. */
#include <avr/io.h>
#include <avr/sleep.h>

#include "filter_steps.h"

static filter_steps all;

static void put_u32(uint32_t value)
{
    GPIOR2 = (unsigned char)(value & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 8) & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 16) & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 24) & 0xFFUL);
}

int main(void)
{
    filter_steps_init(&all, 0);
    while (GPIOR1 != 0U) {
        if (filter_steps_push(&all, GPIOR0) != 0U) {
            put_u32(all.hash);
        }
    }
    put_u32(filter_steps_hash(&all));
    sleep_cpu(); /* with interrupts off: the simulator takes it as the end */
    return 0;
}
