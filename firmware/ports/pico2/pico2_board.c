/*
 * Raspberry Pi Pico 2, either processor: UART0 on GP0 (out) and GP1 (in) at a USB adapter or Debug Probe of 3.3 V, the
 * light on GP25. The USB connector only feeds the board.
 *
 * No interrupts: the UART holds 32 octets each way, the main loop fetches and fills them. Milliseconds come from TIMER0,
 * which counts microseconds of the crystal; cycles from the platform timer at the system clock, which either processor has.
 */
#include "fs_app.h"
#include "fs_board.h"
#include "fs_start.h"
#include "pico2_registers.h"

#ifndef PICO2_BAUD
#define PICO2_BAUD 115200UL
#endif
#if PICO2_BAUD < 1200UL
#error "PICO2_BAUD: below 1200 baud the pause between two octets passes for the end of a frame (FS_APP_SILENCE_MS)"
#elif PICO2_BAUD > 4000000UL
#error "PICO2_BAUD: 4000000 baud at most"
#endif

#define CLOCK_HZ 150000000UL /* of the crystal's 12 MHz: by 125, over 5 and 2 */
#define PLL_FEEDBACK 125UL
#define PLL_DIVIDERS ((5UL << 16) | (2UL << 12))
#define CRYSTAL_MHZ 12UL
#define CRYSTAL_STARTUP 282UL                                         /* in 256 periods: 6 ms */
#define DIVIDER_64 ((CLOCK_HZ * 4UL + PICO2_BAUD / 2UL) / PICO2_BAUD) /* of clk_peri / 16, in 64ths */

#define TRANSMIT_PIN 0UL
#define RECEIVE_PIN 1UL
#define LIGHT_PIN 25UL
#define WATCHDOG_US 100000UL

static uint32_t milliseconds, counted_us, serviced_ms, overruns, errors;

static void await(volatile const uint32_t *at, uint32_t bits)
{
    while ((*at & bits) != bits) {
    }
}

static void leave_reset(uint32_t parts)
{
    PICO2_CLEAR(RESETS_AT) = parts;
    await(&RESETS_DONE, parts);
}

/* The boot ROM leaves the chip at its ring oscillator. */
static void start_clock(void)
{
    XOSC_STARTUP = CRYSTAL_STARTUP;
    XOSC_CTRL = XOSC_ENABLE_1_TO_15_MHZ;
    await(&XOSC_STATUS, XOSC_STABLE);
    PICO2_REGISTER(CLK_REF_CTRL_AT) = CLK_REF_FROM_XOSC;
    await(&CLK_REF_SELECTED, 1UL << CLK_REF_FROM_XOSC);
    PICO2_CLEAR(CLK_SYS_CTRL_AT) = CLK_SYS_FROM_AUX;
    await(&CLK_SYS_SELECTED, 1UL);
    PICO2_SET(RESETS_AT) = RESETS_PLL_SYS;
    leave_reset(RESETS_PLL_SYS);
    PLL_SYS_CS = 1UL; /* reference divided by 1 */
    PLL_SYS_FBDIV = PLL_FEEDBACK;
    PICO2_CLEAR(PLL_SYS_PWR_AT) = PLL_PWR_CORE;
    await(&PLL_SYS_CS, PLL_LOCK);
    PLL_SYS_PRIM = PLL_DIVIDERS;
    PICO2_CLEAR(PLL_SYS_PWR_AT) = PLL_PWR_DIVIDERS;
    PICO2_REGISTER(CLK_SYS_CTRL_AT) = 0UL; /* choose the auxiliary source while it is not in use */
    PICO2_SET(CLK_SYS_CTRL_AT) = CLK_SYS_FROM_AUX;
    await(&CLK_SYS_SELECTED, 1UL << CLK_SYS_FROM_AUX);
    CLK_PERI_CTRL = CLK_PERI_ENABLE;
}

static void start_uart(void)
{
    leave_reset(RESETS_IO_BANK0 | RESETS_PADS_BANK0 | RESETS_UART0);
    UART0_IBRD = DIVIDER_64 / 64UL;
    UART0_FBRD = DIVIDER_64 % 64UL;
    UART0_LCR_H = UART_8N1_WITH_FIFO; /* after the divisors, which it takes over */
    UART0_CR = UART_ENABLE;
    IO_BANK0_CTRL(TRANSMIT_PIN) = IO_UART;
    IO_BANK0_CTRL(RECEIVE_PIN) = IO_UART;
    IO_BANK0_CTRL(LIGHT_PIN) = IO_SIO;
    PADS_BANK0(TRANSMIT_PIN) = PAD_OUTPUT;
    PADS_BANK0(RECEIVE_PIN) = PAD_INPUT_PULLED_UP; /* a line that is off reads as silence */
    PADS_BANK0(LIGHT_PIN) = PAD_OUTPUT;
    SIO_OE_SET = 1UL << LIGHT_PIN;
}

void fs_board_init(void)
{
    start_clock();
    start_uart();
    leave_reset(RESETS_TIMER0);
    TICKS_TIMER0_CYCLES = CRYSTAL_MHZ;
    TICKS_TIMER0_CTRL = 1UL;
    TICKS_WATCHDOG_CYCLES = CRYSTAL_MHZ;
    TICKS_WATCHDOG_CTRL = 1UL;
    counted_us = TIMER0_RAW_LOW;
    SIO_MTIME_CTRL = SIO_MTIME_EVERY_CYCLE;
    PSM_WDSEL = PSM_WDSEL_ALL & ~PSM_WDSEL_OSCILLATORS;
    WATCHDOG_LOAD = WATCHDOG_US;
    PICO2_SET(WATCHDOG_CTRL_AT) = WATCHDOG_ENABLE;
}

uint32_t fs_board_clock_hz(void)
{
    return CLOCK_HZ;
}

uint32_t fs_board_baud(void)
{
    return PICO2_BAUD;
}

uint16_t fs_board_was_watchdog(void)
{
    return ((WATCHDOG_REASON & WATCHDOG_REASON_TIMER) != 0U) ? 1U : 0U;
}

uint16_t fs_board_receive(fs_octet *octet)
{
    uint32_t word;

    if ((UART0_FR & UART_FR_RECEIVE_EMPTY) != 0U) {
        return 0U;
    }
    word = UART0_DR;
    if ((word & UART_DR_DAMAGED) != 0U) {
        errors++;
    }
    if ((word & UART_DR_OVERRUN) != 0U) {
        overruns++;
    }
    *octet = (fs_octet)(word & 0xFFU);
    return 1U;
}

uint16_t fs_board_can_send(void)
{
    return ((UART0_FR & UART_FR_TRANSMIT_FULL) == 0U) ? 1U : 0U;
}

void fs_board_send(fs_octet octet)
{
    UART0_DR = octet;
}

uint32_t fs_board_overruns(void)
{
    return overruns;
}

uint32_t fs_board_errors(void)
{
    return errors;
}

/* Counted up from TIMER0, without a division of 64 bits; called far more often than the 71 minutes of its low half. */
uint32_t fs_board_now_ms(void)
{
    const uint32_t now_us = TIMER0_RAW_LOW;

    while (now_us - counted_us >= 1000U) {
        counted_us += 1000U;
        milliseconds++;
    }
    return milliseconds;
}

uint32_t fs_board_now_us(void)
{
    return TIMER0_RAW_LOW;
}

uint32_t fs_board_cycles(void)
{
    return SIO_MTIME_LOW;
}

uint32_t fs_board_stack_size(void)
{
    return fs_stack_bytes();
}

uint32_t fs_board_stack_high_water(void)
{
    return fs_stack_used();
}

/* The light beats each 512 ms, and flickers while the target is stopped. */
void fs_board_pass(uint32_t now_ms, uint16_t state)
{
    const uint32_t beat = (state == FS_APP_SAFE || state == FS_APP_RESTARTED) ? 0x40U : 0x200U;

    if (now_ms != serviced_ms) {
        serviced_ms = now_ms;
        WATCHDOG_LOAD = WATCHDOG_US;
        if ((now_ms & beat) != 0U) {
            SIO_OUT_SET = 1UL << LIGHT_PIN;
        } else {
            SIO_OUT_CLEAR = 1UL << LIGHT_PIN;
        }
    }
}
