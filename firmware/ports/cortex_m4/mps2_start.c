/* Reset, vectors, and the stack's paint. */
#include "mps2_board.h"
#include "semihosting.h"

#define PAINT 0xA5A5A5A5UL

/* from the linker script: only their addresses mean something */
extern uint32_t fs_stack_bottom[], fs_stack_top[];
extern uint32_t fs_data_load[], fs_data_start[], fs_data_end[], fs_bss_start[], fs_bss_end[];

void mps2_reset(void);
void mps2_fault(void);

typedef void (*handler)(void);

typedef struct {
    uint32_t *stack;
    handler exceptions[15];
    handler interrupts[32];
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    fs_stack_top,
    {
        mps2_reset, mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_fault,
        mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_fault, mps2_tick_interrupt,
    },
    {mps2_uart_receive_interrupt, mps2_uart_send_interrupt},
};

static void paint_stack(void)
{
    uint32_t *const here = __builtin_frame_address(0);
    uint32_t *at;

    /* below this function's own frame, with room for what it may still push */
    for (at = fs_stack_bottom; at < here - 32; at++) {
        *(volatile uint32_t *)at = PAINT;
    }
}

__attribute__((noreturn)) void mps2_reset(void)
{
    const uint32_t *from = fs_data_load;
    uint32_t *at;

    MPS2_FPU_ACCESS |= 0xFUL << 20; /* before the first floating-point instruction: full access to CP10, CP11 */
    __asm__ volatile("dsb\n isb" : : : "memory");
    for (at = fs_data_start; at < fs_data_end; at++) {
        *(volatile uint32_t *)at = *from++;
    }
    for (at = fs_bss_start; at < fs_bss_end; at++) {
        *(volatile uint32_t *)at = 0U;
    }
    paint_stack();
    semihosting_exit(main() == 0);
}

__attribute__((noreturn)) void mps2_fault(void)
{
    semihosting_write_text("flightstack: fault\n");
    semihosting_exit(0);
}

uint32_t mps2_stack_size(void)
{
    return (uint32_t)((fs_stack_top - fs_stack_bottom) * 4);
}

uint32_t mps2_stack_high_water(void)
{
    const uint32_t *at = fs_stack_bottom;

    while (at < fs_stack_top && *at == PAINT) {
        at++;
    }
    return (uint32_t)((fs_stack_top - at) * 4);
}
