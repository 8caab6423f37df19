/* The steps on an AVR, where int has 16 bits and float arithmetic is a library.
 *
 * Three general-purpose registers are the link to the simulator (avr_simulator.c): reading GPIOR1 tells whether
 * there is another octet, reading GPIOR0 takes it, and each octet written to GPIOR2 is a result: after every step
 * the hash so far, and at the end the number of parameters refused.
 */
#include <avr/io.h>
#include <avr/sleep.h>

#include "steps.h"

static steps all;

static void put_u32(uint32_t value)
{
    GPIOR2 = (unsigned char)(value & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 8) & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 16) & 0xFFUL);
    GPIOR2 = (unsigned char)((value >> 24) & 0xFFUL);
}

int main(void)
{
    steps_init(&all, 0);
    while (GPIOR1 != 0U) {
        /* rubbish in the high bits, which the codec has to mask */
        if (steps_push(&all, (fs_octet)(GPIOR0 | 0xA500U)) != 0U) {
            put_u32(all.hash);
        }
    }
    put_u32(all.refused);
    sleep_cpu(); /* with interrupts off: the simulator takes it as the end */
    return 0;
}
