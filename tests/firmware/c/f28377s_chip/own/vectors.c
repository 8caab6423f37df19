/* interrupt.c */
#include "driverlib.h"

static void unexpected(void)
{
    __builtin_trap(); /* driverlib's default handler stops here for ever */
}

void Interrupt_initVectorTable(void)
{
    uint32_t i;

    EALLOW;
    for (i = 3U; i < 224U; i++) {
        HWREG(PIEVECTTABLE_BASE + 2U * i) = (uint32_t)(uintptr_t)&unexpected;
    }
    EDIS;
}
