/* Vectors, boot block and reset of an RP2350's Cortex-M33. */
#include "fs_start.h"
#include "pico2_registers.h"

#define FPU_ACCESS PICO2_REGISTER(0xE000ED88UL)

extern uint32_t fs_stack_top[]; /* from the linker script: only its address means something */

void pico2_reset(void);
void pico2_fault(void);

typedef void (*handler)(void);

typedef struct {
    uint32_t *stack;
    handler exceptions[15];
} vector_table;

/* No interrupt is enabled: beyond the exceptions nothing is needed. */
__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    fs_stack_top,
    {
        pico2_reset, pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault,
        pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault, pico2_fault,
    },
};

/* The boot ROM starts an image that has this block in its first 4 KiB (datasheet 5.9.5): secure, Arm, RP2350. */
__attribute__((section(".image_def"), used)) static const uint32_t image_def[] = {
    0xFFFFDED3UL, /* begin */
    0x10210142UL, /* image type, one word */
    0x000001FFUL, /* last item: one word before it */
    0x00000000UL, /* no other block */
    0xAB123579UL, /* end */
};

__attribute__((noreturn)) void pico2_reset(void)
{
    FPU_ACCESS |= 0xFUL << 20; /* before the first floating-point instruction: full access to CP10, CP11 */
    __asm__ volatile("dsb\n isb" : : : "memory");
    fs_start();
}

/* The watchdog restarts the processor. */
__attribute__((noreturn)) void pico2_fault(void)
{
    for (;;) {
    }
}
