/* What the entry of the emulated image offers, and what it calls. */
#ifndef EMULATED_START_H
#define EMULATED_START_H

#include "fs_mailbox.h"

uint32_t fs_port_clock(void);      /* instructions executed so far, modulo 2^32 */
fs_mailbox *fs_port_mailbox(void); /* mapped by the emulator */
__attribute__((used)) void fs_emulated_serve(void); /* written by each image: one exchange */

#endif
