/* Counts instructions for the emulator: compiled for the host, called by unicorn when a basic block begins.
 *
 * In Python the call would cost more than the block. Blocks are counted by reading the length of each instruction
 * from the code: 32 bits when its first half-word begins with 11101, 11110 or 11111 (ARMv7-M manual, A5.1).
 */
#include <stdint.h>

#define FS_COUNTER_BLOCKS 262144U /* half-words of 512 KiB of code */

typedef struct {
    uint32_t *clock;             /* the mailbox's counter */
    const uint16_t *code;        /* image of the code at address 0, in half-words */
    int (*stop)(void *emulator); /* uc_emu_stop */
    uint32_t code_size;          /* octets of `code` */
    uint32_t uncounted;          /* address of the clock function, whose instructions are not counted */
    uint32_t limit;              /* value of the clock at which a run that does not end is stopped */
    uint32_t reserved;
    struct {
        uint32_t size, instructions; /* of the block that begins here, when it was last seen; size 0: never */
    } block[FS_COUNTER_BLOCKS];
} fs_counter;

uint32_t fs_counter_size(void);
void fs_counter_block(void *emulator, uint64_t address, uint32_t size, void *counter);

/* Size of fs_counter in octets, for its allocation. */
uint32_t fs_counter_size(void)
{
    return (uint32_t)sizeof(fs_counter);
}

static uint32_t count(const fs_counter *counter, uint32_t address, uint32_t size)
{
    const uint32_t end = (address + size) / 2U;
    uint32_t instructions = 0U;
    uint32_t at = address / 2U;

    while (at < end) {
        at += ((counter->code[at] & 0xF800U) >= 0xE800U) ? 2U : 1U;
        instructions++;
    }
    return instructions;
}

void fs_counter_block(void *emulator, uint64_t address, uint32_t size, void *counter)
{
    fs_counter *const own = counter;
    const uint32_t place = (uint32_t)address & ~1U;

    if (place == own->uncounted || place >= own->code_size || size > own->code_size - place) {
        return;
    }
    if (own->block[place / 2U].size != size) {
        own->block[place / 2U].size = size;
        own->block[place / 2U].instructions = count(own, place, size);
    }
    *own->clock += own->block[place / 2U].instructions;
    if ((own->limit - *own->clock) >> 31 != 0U) {
        (void)own->stop(emulator);
    }
}
