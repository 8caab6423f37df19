/* Boot block and reset of an RP2350's Hazard3 (RISC-V, no floating-point unit). */
#include <stdint.h>

extern uint32_t fs_stack_top[]; /* from the linker script: only its address means something */

void pico2_reset(void);
void pico2_fault(void);

typedef struct {
    uint32_t begin, image_type, entry_point;
    void (*entry)(void);
    uint32_t *stack;
    uint32_t last, next, end;
} boot_block;

/* The boot ROM starts an image that has this block in its first 4 KiB (datasheet 5.9.5): RISC-V, RP2350. */
__attribute__((section(".image_def"), used)) static const boot_block image_def = {
    0xFFFFDED3UL,
    0x11010142UL, /* image type, one word */
    0x00000344UL, /* entry point, three words */
    pico2_reset,
    fs_stack_top,
    0x000004FFUL, /* last item: four words before it */
    0x00000000UL, /* no other block */
    0xAB123579UL,
};

__asm__(".section .text.pico2_reset, \"ax\", %progbits\n"
        ".global pico2_reset, pico2_fault\n"
        ".type pico2_reset, %function\n"
        ".type pico2_fault, %function\n"
        ".balign 64\n"
        "pico2_reset:\n"
        "    la sp, fs_stack_top\n"
        "    la t0, pico2_fault\n"
        "    csrw mtvec, t0\n"
        "    j fs_start\n"
        ".balign 64\n"
        "pico2_fault:\n" /* the watchdog restarts the processor */
        "    j pico2_fault\n"
        ".previous\n");
