#define _POSIX_C_SOURCE 200809L

#include "fs_host.h"

#include <time.h>

#include "fs_build.h"

#define NANOSECONDS_PER_S 1000000000ULL
#define BAUD 115200UL
#define NANOSECONDS_PER_US 1000ULL
#define NANOSECONDS_PER_MS 1000000ULL

static const fs_octet source_hash[8] = {FS_SOURCE_HASH};

/* A pseudo-terminal has no baud rate: every one is as good as another. */
static uint16_t take_any_baud(uint32_t baud)
{
    return (baud > 0UL) ? 1U : 0U;
}

static const fs_port port = {
    .clock = fs_host_nanoseconds,
    .clock_hz = 0UL, /* whatever it is at the moment */
    .cost_unit = FS_COST_NANOSECONDS,
    .was_watchdog = 0U,
    .board = "host",
    .compiler = FS_COMPILER,
    .source_hash = source_hash,
    .stack_size = 0UL,
    .stack_high_water = NULL,
    .baud = BAUD,
    .can_set_baud = take_any_baud,
    .set_baud = take_any_baud,
};

const fs_port *fs_host_port(void)
{
    return &port;
}

static uint64_t now_ns(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now); /* by POSIX it fails only without such a clock */
    return (uint64_t)now.tv_sec * NANOSECONDS_PER_S + (uint64_t)now.tv_nsec;
}

uint32_t fs_host_nanoseconds(void)
{
    return (uint32_t)(now_ns() & 0xFFFFFFFFULL);
}

uint32_t fs_host_microseconds(void)
{
    return (uint32_t)((now_ns() / NANOSECONDS_PER_US) & 0xFFFFFFFFULL);
}

uint32_t fs_host_milliseconds(void)
{
    return (uint32_t)((now_ns() / NANOSECONDS_PER_MS) & 0xFFFFFFFFULL);
}
