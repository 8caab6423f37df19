/* Vectors and reset of an STM32F401 or STM32F446. */
#include "fs_start.h"
#include "nucleo_registers.h"

#define INTERRUPTS (USART2_IRQ + 1U) /* as far as the last one in use */

extern uint32_t fs_stack_top[]; /* from the linker script: only its address means something */

void nucleo_reset(void);
void nucleo_fault(void);

typedef void (*handler)(void);

typedef struct {
    uint32_t *stack;
    handler exceptions[15];
    handler interrupts[INTERRUPTS];
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    fs_stack_top,
    {
        nucleo_reset, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault,
        nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_fault, nucleo_millisecond,
    },
    {[USART2_IRQ] = nucleo_received},
};

__attribute__((noreturn)) void nucleo_reset(void)
{
    FPU_ACCESS |= 0xFUL << 20; /* before the first floating-point instruction: full access to CP10, CP11 */
    __asm__ volatile("dsb\n isb" : : : "memory");
    fs_start();
}

/* The watchdog restarts the processor. */
__attribute__((noreturn)) void nucleo_fault(void)
{
    for (;;) {
    }
}
