#include "f28_time.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"

static volatile uint32_t milliseconds;

#define CYCLES_PER_US ((uint32_t)F28_SYSCLK_HZ / (uint32_t)1000000UL)

static uint32_t taken, microseconds; /* cycles that are counted as microseconds */
static volatile uint32_t interrupted; /* cycles that interrupts took */

static uint32_t count_up(void)
{
    return 0xFFFFFFFFUL - CPUTimer_getTimerCount(CPUTIMER1_BASE);
}

uint32_t f28_interrupt_begins(void)
{
    return count_up();
}

void f28_interrupt_ends(uint32_t began)
{
    interrupted = interrupted + (count_up() - began);
}

static __interrupt void on_millisecond(void)
{
    const uint32_t began = f28_interrupt_begins();

    milliseconds = milliseconds + 1UL;
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP1);
    f28_interrupt_ends(began);
}

/* Make a timer count down from `last` to 0, over and over, at SYSCLK. */
static void start_timer(uint32_t base, uint32_t last)
{
    CPUTimer_stopTimer(base);
    CPUTimer_setPreScaler(base, 0U);
    CPUTimer_setPeriod(base, last);
    CPUTimer_reloadTimerCounter(base);
    CPUTimer_clearOverflowFlag(base);
}

void f28_time_init(void)
{
    milliseconds = 0UL;
    interrupted = 0UL;
    microseconds = 0UL;
    start_timer(CPUTIMER0_BASE, F28_SYSCLK_HZ / 1000UL - 1UL);
    start_timer(CPUTIMER1_BASE, 0xFFFFFFFFUL);
    Interrupt_register(INT_TIMER0, &on_millisecond);
    CPUTimer_enableInterrupt(CPUTIMER0_BASE);
    Interrupt_enable(INT_TIMER0);
    CPUTimer_startTimer(CPUTIMER0_BASE);
    CPUTimer_startTimer(CPUTIMER1_BASE);
    taken = count_up();
}

uint32_t f28_now_ms(void)
{
    uint32_t first, second;

    do { /* the interrupt may count between the two halves of the number */
        first = milliseconds;
        second = milliseconds;
    } while (first != second);
    return first;
}

/* Whole microseconds are taken off the counter, whose wrap is no whole number of them. */
uint32_t f28_now_us(void)
{
    const uint32_t passed = (count_up() - taken) / CYCLES_PER_US;

    taken += passed * CYCLES_PER_US;
    microseconds += passed;
    return microseconds;
}

uint32_t f28_cycles(void)
{
    const bool was_off = Interrupt_disableGlobal(); /* both counts are of the same moment */
    const uint32_t cycles = count_up() - interrupted;

    if (!was_off) {
        (void)Interrupt_enableGlobal();
    }
    return cycles;
}
