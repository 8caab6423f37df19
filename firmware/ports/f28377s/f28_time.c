#include "f28_time.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"

static volatile uint32_t milliseconds;

static __interrupt void on_millisecond(void)
{
    milliseconds = milliseconds + 1UL;
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP1);
}

/* Let a timer count down from `last` to 0, over and over, at SYSCLK. */
static void start(uint32_t base, uint32_t last)
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
    start(CPUTIMER0_BASE, F28_SYSCLK_HZ / 1000UL - 1UL);
    start(CPUTIMER1_BASE, 0xFFFFFFFFUL);
    Interrupt_register(INT_TIMER0, &on_millisecond);
    CPUTimer_enableInterrupt(CPUTIMER0_BASE);
    Interrupt_enable(INT_TIMER0);
    CPUTimer_startTimer(CPUTIMER0_BASE);
    CPUTimer_startTimer(CPUTIMER1_BASE);
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

uint32_t f28_cycles(void)
{
    return 0xFFFFFFFFUL - CPUTimer_getTimerCount(CPUTIMER1_BASE);
}
