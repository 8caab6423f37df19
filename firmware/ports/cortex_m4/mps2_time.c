/* Milliseconds by SysTick, costs by a 32-bit timer. */
#include "mps2_board.h"

#define NANOSECONDS_PER_TICK 40U /* 25 MHz */
#define TICKS_PER_MICROSECOND 25U

static volatile uint32_t milliseconds;
static uint32_t last_ticks;
static uint32_t wraps;

void mps2_tick_interrupt(void)
{
    milliseconds = milliseconds + 1U;
}

void mps2_time_init(void)
{
    MPS2_TIMER0_RELOAD = 0xFFFFFFFFUL;
    MPS2_TIMER0_VALUE = 0xFFFFFFFFUL;
    MPS2_TIMER0_CONTROL = MPS2_TIMER_ENABLE;
}

void mps2_tick_init(void)
{
    MPS2_SYSTICK_RELOAD = MPS2_CLOCK_HZ / 1000U - 1U;
    MPS2_SYSTICK_VALUE = 0U;
    MPS2_SYSTICK_CONTROL = MPS2_SYSTICK_RUN;
}

uint32_t mps2_now_ms(void)
{
    return milliseconds;
}

/* ticks of 40 ns since the start; to be called at least every 171 s */
static uint64_t ticks(void)
{
    const uint32_t now = 0xFFFFFFFFUL - MPS2_TIMER0_VALUE;

    if (now < last_ticks) {
        wraps++;
    }
    last_ticks = now;
    return ((uint64_t)wraps << 32) | now;
}

uint32_t mps2_microseconds(void)
{
    return (uint32_t)(ticks() / TICKS_PER_MICROSECOND);
}

uint32_t mps2_nanoseconds(void)
{
    return (uint32_t)(ticks() * NANOSECONDS_PER_TICK);
}

/* With -icount shift=10 every instruction takes 1024 ns = 25.6 ticks: n instructions show as floor(25.6 n) ticks,
 * and 5/128 of that, rounded up, is n again. */
uint32_t mps2_instructions(void)
{
    return (uint32_t)((ticks() * 5U + 127U) >> 7);
}
