#include "f28_watchdog.h"

#include "driverlib.h"
#include "device.h"

static uint32_t last_ms;

uint16_t f28_watchdog_was_cause(void)
{
    const uint32_t cause = SysCtl_getResetCause() & (SYSCTL_CAUSE_WDRS | SYSCTL_CAUSE_NMIWDRS);

    EALLOW;
    SysCtl_clearResetCause(cause);
    EDIS;
    return (cause != 0UL) ? 1U : 0U;
}

void f28_watchdog_start(uint32_t now_ms)
{
    last_ms = now_ms;
    /* 256 counts of INTOSC1 (10 MHz) / 512 / 8: 105 ms. It resets, as it does out of reset, and raises no interrupt. */
    SysCtl_setWatchdogPrescaler(SYSCTL_WD_PRESCALE_8);
    SysCtl_serviceWatchdog();
    SysCtl_enableWatchdog();
}

void f28_watchdog_pass(uint32_t now_ms)
{
    if (now_ms != last_ms) {
        last_ms = now_ms;
        SysCtl_serviceWatchdog();
    }
}
