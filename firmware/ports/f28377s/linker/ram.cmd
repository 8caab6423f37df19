/*
 * The firmware in RAM, for work with a debugger: nothing survives a reset, the flash stays as it is.
 *
 * Addresses and lengths are in 16-bit words. Blocks of RAM that follow each other are one region here. The last 8 words
 * of M1 and of the whole RAM are left out: fetching ahead over their end is an erratum of the chip. The beginning of M0
 * is the boot ROM's.
 */
MEMORY
{
    BEGIN       : origin = 0x000000, length = 0x000002  /* where the boot ROM and a debugger begin */
    RAMM0       : origin = 0x000123, length = 0x0002DD
    RAMM1       : origin = 0x000400, length = 0x0003F8
    RAMLS       : origin = 0x008000, length = 0x003000  /* LS0 to LS5 */
    RAMD0       : origin = 0x00B000, length = 0x000800
    RAMD1       : origin = 0x00B800, length = 0x000800
    RAMGS_DATA  : origin = 0x00C000, length = 0x006000  /* GS0 to GS5 */
    RAMGS_CODE  : origin = 0x012000, length = 0x005FF8  /* GS6 to GS11 */
    RESET       : origin = 0x3FFFC0, length = 0x000002
}

SECTIONS
{
    codestart   : > BEGIN
    .TI.ramfunc : > RAMM0
    .text       : >> RAMLS | RAMD0 | RAMGS_CODE
    .switch     : > RAMM0
    .cinit      : > RAMGS_DATA
    .init_array : > RAMM0

    .stack      : > RAMD1, RUN_START(f28_stack)  /* the stack pointer has 16 bits */
    .bss        : > RAMGS_DATA
    .data       : > RAMGS_DATA
    .const      : > RAMGS_DATA
    .sysmem     : > RAMM1
    .reset      : > RESET, TYPE = DSECT          /* is in the boot ROM */
}
