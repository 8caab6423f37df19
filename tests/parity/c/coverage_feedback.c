/* Counts basic blocks that run for the first time, for a search of inputs; writes gcov's counters on demand. */
#include <stdint.h>

#define BLOCKS 65536U

extern void __gcov_dump(void);
void __sanitizer_cov_trace_pc(void);
uint32_t coverage_fresh(void);
void coverage_write(void);

static uint8_t seen[BLOCKS];
static uint32_t fresh;

void __sanitizer_cov_trace_pc(void)
{
    uint8_t *const block = &seen[(uintptr_t)__builtin_return_address(0) % BLOCKS];

    fresh += *block == 0U;
    *block = 1U;
}

uint32_t coverage_fresh(void)
{
    const uint32_t count = fresh;

    fresh = 0U;
    return count;
}

void coverage_write(void)
{
    __gcov_dump();
}
