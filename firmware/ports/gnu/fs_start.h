/* From reset to the main loop, for gcc and clang: memory as C expects it, the stack painted, then fs_bare. */
#ifndef FS_START_H
#define FS_START_H

#include <stdint.h>

/* Called by a board's reset code with the stack pointer set and the floating-point unit on. */
__attribute__((noreturn)) void fs_start(void);

uint32_t fs_stack_size(void);       /* bytes */
uint32_t fs_stack_high_water(void); /* bytes of it that were ever used */

#endif
