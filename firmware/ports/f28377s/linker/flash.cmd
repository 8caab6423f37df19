/*
 * The firmware in flash: it starts by itself. Code and constants stay there, and the functions that the flash's own
 * waiting would disturb are copied into RAM by Device_init.
 *
 * Addresses and lengths are in 16-bit words. Only the first bank is used (sectors A to N); its last 16 words are left
 * out, since fetching ahead over their end is an erratum of the chip. Sections begin at multiples of 8, because the
 * flash is programmed and checked in units of 128 bits.
 */
MEMORY
{
    BEGIN       : origin = 0x080000, length = 0x000002  /* where the boot ROM begins in mode "flash" */
    FLASH       : origin = 0x080002, length = 0x03FFEE
    RAMM0       : origin = 0x000123, length = 0x0002DD
    RAMM1       : origin = 0x000400, length = 0x0003F8
    RAMLS       : origin = 0x008000, length = 0x003000  /* LS0 to LS5 */
    RAMD0       : origin = 0x00B000, length = 0x000800
    RAMD1       : origin = 0x00B800, length = 0x000800
    RAMGS       : origin = 0x00C000, length = 0x00BFF8  /* GS0 to GS11 */
    RESET       : origin = 0x3FFFC0, length = 0x000002
}

SECTIONS
{
    codestart   : > BEGIN, ALIGN(8)
    .text       : > FLASH, ALIGN(8)
    .switch     : > FLASH, ALIGN(8)
    .cinit      : > FLASH, ALIGN(8)
    .init_array : > FLASH, ALIGN(8)
    .const      : > FLASH, ALIGN(8)

    .TI.ramfunc : LOAD = FLASH, RUN = RAMLS,     /* the names are those that C2000Ware's device.c copies by */
                  LOAD_START(RamfuncsLoadStart), LOAD_SIZE(RamfuncsLoadSize), LOAD_END(RamfuncsLoadEnd),
                  RUN_START(RamfuncsRunStart), RUN_SIZE(RamfuncsRunSize), RUN_END(RamfuncsRunEnd),
                  ALIGN(8)

    .stack      : > RAMD1, RUN_START(f28_stack)  /* the stack pointer has 16 bits */
    .bss        : > RAMGS
    .data       : > RAMGS
    .sysmem     : > RAMM1
    .reset      : > RESET, TYPE = DSECT          /* is in the boot ROM */
}
