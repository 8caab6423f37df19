/* Where the emulator enters, and the clock that counts instructions.
 *
 * The emulator adds the instructions of every basic block to the mailbox when the block begins. fs_port_clock is
 * a function of one block that is itself counted as nothing, so the difference of two readings is exactly the
 * number of instructions between them. An instruction that an IT block skips counts, as it takes its cycle.
 */
#include "emulated_start.h"

void fs_emulated_exchange(void);
void fs_emulated_stop(void);

/* a fixed place: the address is the emulator's, which maps the mailbox there */
#define MAILBOX ((volatile const fs_mailbox *)FS_MAILBOX_ADDRESS)

__asm__(".section .text.fs_emulated, \"ax\", %progbits\n"
        ".syntax unified\n"
        ".thumb\n"
        ".align 2\n"
        ".global fs_emulated_exchange, fs_emulated_stop\n"
        ".type fs_emulated_exchange, %function\n"
        ".type fs_emulated_stop, %function\n"
        "fs_emulated_exchange:\n"
        "    bl fs_emulated_serve\n"
        "fs_emulated_stop:\n"
        "    b fs_emulated_stop\n"
        ".previous\n");

__attribute__((noinline)) uint32_t fs_port_clock(void)
{
    return MAILBOX->instructions;
}

fs_mailbox *fs_port_mailbox(void)
{
    return (fs_mailbox *)FS_MAILBOX_ADDRESS;
}
