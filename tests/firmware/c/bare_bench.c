/* A board in memory for the main loop of ports/bare: the line, the time, and faults that a new port may have. */
#include "fs_bare.h"
#include "fs_board.h"
#include "fs_ring.h"

#ifdef BENCH_FLUSHES
#include <xmmintrin.h>
#endif

enum {
    SMALL_RING = 1, NO_TIME, SLOW_TIME, FAST_TIME, TIME_RUNS_BACK, NO_CYCLES, CYCLES_COUNT_DOWN, SEVEN_BITS, XON_XOFF,
    NEW_LINES, DROPS_SENT, ECHO, STACK_FULL, WAS_WATCHDOG, NOISE, NO_US, US_STAND_STILL, US_SLOW, US_RUN_BACK, US_WRAP_EARLY,
    US_WRAP
};
#define RING 4096U
#define US_PER_PASS 50U

int bench_fault;
static volatile fs_octet received_octets[RING], sent_octets[32768];
static fs_ring received, sent;
/* The firmware measures the cost of a reading at its start; later there is work between two of them. */
#define START_READINGS 32U
static uint64_t now_us;
static uint32_t cycles, readings, overruns, octets_sent;

void bench_start(int fault);
void bench_receive(const unsigned char *octets, uint32_t count);
void bench_run(uint32_t us);
uint32_t bench_sent(unsigned char *out, uint32_t room);

void bench_start(int fault)
{
    bench_fault = fault;
    fs_ring_init(&received, received_octets, (fault == SMALL_RING) ? 64U : RING);
    fs_ring_init(&sent, sent_octets, 32768U);
    now_us = (fault == US_WRAP) ? (1ULL << 32) - 8000000ULL : 0ULL;
    cycles = 0U;
    readings = 0U;
    overruns = 0U;
    octets_sent = 0U;
    fs_bare_start();
}

void bench_receive(const unsigned char *octets, uint32_t count)
{
    uint32_t i;

    for (i = 0U; i < count; i++) {
        fs_octet octet = octets[i];

        if (bench_fault == XON_XOFF && (octet == 0x11U || octet == 0x13U)) {
            continue;
        }
        octet = (bench_fault == SEVEN_BITS) ? (octet & 0x7FU) : octet;
        octet = (bench_fault == NOISE && i % 29U == 28U) ? (octet ^ 0x10U) : octet;
        if (bench_fault == ECHO) {
            (void)fs_ring_put(&sent, octet);
        }
        if (fs_ring_put(&received, octet) == 0U) {
            overruns++;
        }
    }
}

void bench_run(uint32_t us)
{
    uint32_t passed;

#ifdef BENCH_FLUSHES
    const unsigned int mode = _mm_getcsr();
    _mm_setcsr(mode | 0x8040U);
#endif
    for (passed = 0U; passed <= us; passed += US_PER_PASS) {
        fs_bare_pass();
        now_us += (passed + US_PER_PASS <= us) ? US_PER_PASS : us - passed;
    }
#ifdef BENCH_FLUSHES
    _mm_setcsr(mode);
#endif
}

uint32_t bench_sent(unsigned char *out, uint32_t room)
{
    uint32_t count = 0U;
    fs_octet octet;

    while (count < room && fs_ring_take(&sent, &octet) != 0U) {
        out[count++] = (unsigned char)octet;
    }
    return count;
}

void fs_board_init(void)
{
}

uint32_t fs_board_clock_hz(void)
{
    return 100000000U;
}

uint32_t fs_board_baud(void)
{
    return 0U;
}

uint16_t fs_board_was_watchdog(void)
{
    return (bench_fault == WAS_WATCHDOG) ? 1U : 0U;
}

uint16_t fs_board_receive(fs_octet *octet)
{
    return fs_ring_take(&received, octet);
}

uint16_t fs_board_can_send(void)
{
    return (fs_ring_room(&sent) > 2U) ? 1U : 0U;
}

void fs_board_send(fs_octet octet)
{
    octets_sent++;
    if (bench_fault == DROPS_SENT && octets_sent % 500U == 0U) {
        return;
    }
    if (bench_fault == NEW_LINES && octet == 0x0AU) {
        (void)fs_ring_put(&sent, 0x0DU);
    }
    (void)fs_ring_put(&sent, octet);
}

uint32_t fs_board_overruns(void)
{
    return overruns;
}

uint32_t fs_board_errors(void)
{
    return 0U;
}

uint32_t fs_board_now_ms(void)
{
    const uint32_t ms = (uint32_t)(now_us / 1000U);

    switch (bench_fault) {
    case NO_TIME:
        return 0U;
    case SLOW_TIME:
        return ms / 8U;
    case FAST_TIME:
        return ms + ms / 20U;
    case TIME_RUNS_BACK:
        return ms % 700U;
    default:
        return ms;
    }
}

uint32_t fs_board_now_us(void)
{
    switch (bench_fault) {
    case NO_US:
        return 0U;
    case US_STAND_STILL:
        return 77U;
    case US_SLOW:
        return (uint32_t)(now_us / 8U);
    case US_RUN_BACK:
        return (uint32_t)(now_us % 700000U);
    case US_WRAP_EARLY: /* as a counter of cycles divided down does */
        return (uint32_t)(now_us % 2000000U);
    default:
        return (uint32_t)now_us;
    }
}

uint32_t fs_board_cycles(void)
{
    const uint32_t passed = (readings++ < START_READINGS) ? 40U : 400U;

    if (bench_fault != NO_CYCLES) {
        cycles += (bench_fault == CYCLES_COUNT_DOWN) ? 0U - passed : passed;
    }
    return cycles;
}

uint32_t fs_board_stack_size(void)
{
    return 4096U;
}

uint32_t fs_board_stack_high_water(void)
{
    return (bench_fault == STACK_FULL) ? 4096U : 900U;
}

void fs_board_pass(uint32_t now_ms, uint16_t state)
{
    (void)now_ms;
    (void)state;
}
