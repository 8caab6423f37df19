/* Counts time for an emulated board: called by unicorn when a basic block begins; stops the emulator at a limit. */
#include <stdint.h>

typedef struct {
    int (*stop)(void *emulator); /* uc_emu_stop */
    uint64_t cycles, limit;
    uint64_t cycles_per_16_bytes; /* of code: some 6 instructions */
    uint64_t stopped_at;          /* block before which it was stopped: the emulator's own counter lags; 0: not stopped */
} board_time;

void board_time_block(void *emulator, uint64_t address, uint32_t size, void *time);

void board_time_block(void *emulator, uint64_t address, uint32_t size, void *time)
{
    board_time *const own = time;

    if (own->cycles >= own->limit) {
        own->stopped_at = address;
        (void)own->stop(emulator);
    } else {
        own->cycles += 1U + size * own->cycles_per_16_bytes / 16U;
    }
}
