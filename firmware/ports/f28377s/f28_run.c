#include "f28_run.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"
#include "f28_lights.h"
#include "f28_serial.h"
#include "f28_stack.h"
#include "f28_time.h"
#include "f28_watchdog.h"
#include "fs_app.h"
#include "fs_build.h"

#if !defined(DEVICE_SYSCLK_FREQ) || DEVICE_SYSCLK_FREQ != 200000000
#error "device.h is set for another crystal: define _LAUNCHXL_F28377S, which has 10 MHz"
#endif

static const fs_octet source_hash[8] = {FS_SOURCE_HASH};
static fs_port port;
static fs_app app;
static fs_octet octets[F28_CHUNK];

static void describe_port(uint16_t was_watchdog)
{
    port.clock = &f28_cycles;
    port.clock_hz = F28_SYSCLK_HZ;
    port.cost_unit = FS_COST_CYCLES;
    port.was_watchdog = was_watchdog;
    port.board = F28_BOARD;
    port.compiler = FS_COMPILER;
    port.source_hash = source_hash;
    port.stack_size = F28_STACK_WORDS;
    port.stack_high_water = &f28_stack_high_water;
    port.baud = F28_BAUD;
    port.can_set_baud = &f28_serial_can_set_baud;
    port.set_baud = &f28_serial_set_baud;
}

void f28_start(void)
{
    const uint16_t was_watchdog = f28_watchdog_was_cause();

    Device_init(); /* 200 MHz from the crystal; the watchdog is off */
    Device_initGPIO();
    SysCtl_setLowSpeedClock(SYSCTL_LSPCLK_PRESCALE_1);
    Interrupt_initModule();
    Interrupt_initVectorTable();
    f28_lights_init();
    f28_serial_init();
    f28_time_init();
    describe_port(was_watchdog);
    (void)Interrupt_enableGlobal();
    fs_app_init(&app, &port); /* measures the clock as steps read it */
    f28_watchdog_start(f28_now_ms());
}

void f28_pass(void)
{
    const uint32_t now_ms = f28_now_ms();
    uint16_t n, count;

    f28_serial_service();
    fs_app_run(&app, f28_now_us());
    count = f28_serial_take(octets, F28_CHUNK);
    for (n = 0U; n < count; n++) {
        fs_app_receive(&app, octets[n]);
    }
    fs_app_uart_errors(&app, f28_serial_overruns(), f28_serial_errors());
    fs_app_poll(&app, now_ms);
    count = f28_serial_room();
    count = fs_app_transmit(&app, octets, (count < F28_CHUNK) ? count : F28_CHUNK);
    (void)f28_serial_give(octets, count); /* all of it: there was room */
    f28_lights_show(now_ms, fs_app_state(&app));
    f28_watchdog_pass(now_ms);
}
