#include "fs_start.h"

#define PAINT 0xA5A5A5A5UL
#define OWN_FRAME 32 /* words below this function's frame address that it may still use */

/* from the linker script: only their addresses mean something */
extern uint32_t fs_stack_bottom[], fs_stack_top[];
extern uint32_t fs_data_load[], fs_data_start[], fs_data_end[], fs_bss_start[], fs_bss_end[];

int main(void);

static void paint_stack(void)
{
    uint32_t *const here = __builtin_frame_address(0);
    uint32_t *at;

    for (at = fs_stack_bottom; at < here - OWN_FRAME; at++) {
        *(volatile uint32_t *)at = PAINT;
    }
}

__attribute__((noreturn)) void fs_start(void)
{
    const uint32_t *from = fs_data_load;
    uint32_t *at;

    for (at = fs_data_start; at < fs_data_end; at++) {
        *(volatile uint32_t *)at = *from++;
    }
    for (at = fs_bss_start; at < fs_bss_end; at++) {
        *(volatile uint32_t *)at = 0U;
    }
    paint_stack();
    (void)main();
    for (;;) {
        /* main does not return on a board */
    }
}

uint32_t fs_stack_size(void)
{
    return (uint32_t)(fs_stack_top - fs_stack_bottom) * 4U;
}

uint32_t fs_stack_high_water(void)
{
    const uint32_t *at = fs_stack_bottom;

    while (at < fs_stack_top && *at == PAINT) {
        at++;
    }
    return (uint32_t)(fs_stack_top - at) * 4U;
}
