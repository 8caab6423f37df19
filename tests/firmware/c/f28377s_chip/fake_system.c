/* CPU timers, watchdog, clock divider, cause of the reset and pins of the simulated chip. */
#include "fake_chip.h"

#include "device.h"

#define WATCHDOG_CYCLES (256U * 512U * (FAKE_SYSCLK / 10000000U)) /* 256 counts of INTOSC1 / 512, unscaled */
#define TIMERS 2U
#define TIMER_WORDS 8U
#define WATCHDOG_WORDS 0x30U
#define CPU_CAUSE_SHOWN 0x8000U /* upper half of RESC, a pin's state: a write has not got it */
#define CTRL_WORDS (6U * 64U)
#define PIN_WORDS (6U * 8U)

typedef struct {
    uint32_t period, count;
    uint16_t running, interrupt_on;
} timer;

static timer timers[TIMERS];
static uint32_t bites, served;
static uint64_t watchdog_since;
static uint16_t key;

/* aligned to 32 bits */
static uint32_t cells[7][192], shown[7][192];
#define CELLS(n) (uint16_t *)cells[n], (uint16_t *)shown[n]
static void timer_written(uint32_t offset), watchdog_written(uint32_t offset), cause_written(uint32_t offset),
    pin_written(uint32_t offset);
fake_area fake_timer_area = {CPUTIMER0_BASE, TIMERS * TIMER_WORDS, CELLS(0), timer_written, 0U};
fake_area fake_watchdog_area = {WD_BASE, WATCHDOG_WORDS, CELLS(1), watchdog_written, 1U};
fake_area fake_clock_area = {CLKCFG_BASE + SYSCTL_O_LOSPCP, 2U, CELLS(2), NULL, 1U};
fake_area fake_cpu_area = {CPUSYS_BASE + SYSCTL_O_RESC, 2U, CELLS(3), cause_written, 1U};
fake_area fake_boot_area = {SYSCTL_BOOT_ROM_STATUS, 2U, CELLS(4), NULL, 0U};
fake_area fake_gpio_area = {0U, CTRL_WORDS, CELLS(5), NULL, 1U};
fake_area fake_pin_area = {0U, PIN_WORDS, CELLS(6), pin_written, 0U};

/* TI's driverlib reaches the pins by pointers to these. */
uint32_t *fake_gpio_control(void);
uint32_t *fake_gpio_data(void);

uint32_t *fake_gpio_control(void)
{
    fake_access();
    fake_hold(&fake_gpio_area);
    return cells[5];
}

uint32_t *fake_gpio_data(void)
{
    fake_access();
    fake_hold(&fake_pin_area);
    return cells[6];
}

static uint32_t word_pair(const fake_area *area, uint32_t offset)
{
    return (uint32_t)area->cells[offset + 1U] << 16U | area->cells[offset];
}

static void timer_written(uint32_t offset)
{
    timer *const t = &timers[offset / TIMER_WORDS];
    const uint32_t base = offset / TIMER_WORDS * TIMER_WORDS;
    const uint16_t value = fake_timer_area.cells[offset];

    switch (offset - base) {
    case CPUTIMER_O_PRD:
    case CPUTIMER_O_PRD + 1U:
        t->period = word_pair(&fake_timer_area, base + CPUTIMER_O_PRD);
        break;
    case CPUTIMER_O_TCR:
        t->running = (value & CPUTIMER_TCR_TSS) == 0U;
        t->interrupt_on = (value & CPUTIMER_TCR_TIE) != 0U;
        if ((value & CPUTIMER_TCR_TRB) != 0U) {
            t->count = t->period;
        }
        fake_show(&fake_timer_area, offset, value & (uint16_t)~(CPUTIMER_TCR_TRB | CPUTIMER_TCR_TIF));
        break;
    case CPUTIMER_O_TIM:
    case CPUTIMER_O_TIM + 1U:
        t->count = word_pair(&fake_timer_area, base + CPUTIMER_O_TIM);
        break;
    default:
        if (value != 0U) {
            fake_note("the simulated timers have no prescaler");
        }
        break;
    }
}

static void watchdog_written(uint32_t offset)
{
    const uint16_t value = fake_watchdog_area.cells[offset];

    if (offset == SYSCTL_O_WDKEY) {
        if (key == SYSCTL_WD_ENRSTKEY && value == SYSCTL_WD_RSTKEY) {
            served++;
            watchdog_since = fake_time();
        }
        key = value;
        fake_show(&fake_watchdog_area, offset, FAKE_UNWRITTEN);
    } else if (offset == SYSCTL_O_WDCR) {
        if ((value & SYSCTL_WDCR_WDCHK_M) != SYSCTL_WD_CHKBITS) {
            fake_note("WDCR was written without its check bits, which resets the chip");
        }
        fake_show(&fake_watchdog_area, offset, value & (uint16_t)~SYSCTL_WDCR_WDCHK_M);
    } else {
        fake_note("a register of the watchdog that the simulated chip has not got");
    }
}

static void show_cause(uint16_t cause)
{
    fake_show(&fake_cpu_area, 0U, cause);
    fake_show(&fake_cpu_area, 1U, CPU_CAUSE_SHOWN);
}

static uint16_t cause_left;

/* Writing 1 clears; the upper half changes with every write. */
static void cause_written(uint32_t offset)
{
    if (offset == 1U) {
        cause_left &= (uint16_t)~fake_cpu_area.cells[0];
        show_cause(cause_left);
    }
}

static void pin_written(uint32_t offset)
{
    const uint32_t port = offset / GPIO_O_GPBDAT * GPIO_O_GPBDAT, half = offset % 2U, at = port + half;
    const uint16_t value = fake_pin_area.cells[offset];

    if (offset - at == GPIO_O_GPASET) {
        fake_show(&fake_pin_area, at, fake_pin_area.cells[at] | value);
        fake_show(&fake_pin_area, offset, 0U);
    } else if (offset - at == GPIO_O_GPACLEAR) {
        fake_show(&fake_pin_area, at, fake_pin_area.cells[at] & (uint16_t)~value);
        fake_show(&fake_pin_area, offset, 0U);
    } else {
        /* GPxDAT, GPxTOGGLE: not used */
    }
}

uint64_t fake_system_next(uint64_t most)
{
    uint32_t i;

    for (i = 0U; i < TIMERS; i++) {
        if (timers[i].running && (uint64_t)timers[i].count + 1U < most) {
            most = (uint64_t)timers[i].count + 1U;
        }
    }
    return most;
}

static void watch(void)
{
    const uint16_t wdcr = fake_watchdog_area.cells[SYSCTL_O_WDCR], scale = wdcr & SYSCTL_WDCR_WDPS_M;

    if ((wdcr & SYSCTL_WDCR_WDDIS) == 0U &&
        fake_time() - watchdog_since >= WATCHDOG_CYCLES << ((scale > 0U) ? scale - 1U : 0U)) {
        bites++;
        watchdog_since = fake_time();
    }
}

void fake_system_pass(uint64_t cycles)
{
    uint32_t i;

    for (i = 0U; i < TIMERS; i++) {
        timer *const t = &timers[i];

        if (!t->running) {
            continue;
        }
        if (cycles > t->count) { /* cycles == count + 1: it was 0 and begins again */
            t->count = t->period;
            if (i == 0U && t->interrupt_on) {
                fake_raise(FAKE_TIMER0);
            }
        } else {
            t->count -= (uint32_t)cycles;
        }
    }
    watch();
}

void fake_system_show(void)
{
    uint32_t i;

    for (i = 0U; i < TIMERS; i++) {
        fake_show(&fake_timer_area, i * TIMER_WORDS + CPUTIMER_O_TIM, timers[i].count & 0xFFFFU);
        fake_show(&fake_timer_area, i * TIMER_WORDS + CPUTIMER_O_TIM + 1U, (uint16_t)(timers[i].count >> 16U));
    }
}

uint32_t fake_lspclk_divider(void)
{
    const uint32_t bits = fake_clock_area.cells[0] & SYSCTL_LOSPCP_LSPCLKDIV_M;

    return (bits == 0U) ? 1U : 2U * bits;
}

void fake_stop_timer0(void)
{
    fake_settle();
    timers[0].running = 0U;
}

uint32_t fake_watchdog_bites(void)
{
    return bites;
}

uint32_t fake_watchdog_served(void)
{
    fake_settle();
    return served;
}

uint32_t fake_pin(uint32_t pin)
{
    fake_settle();
    return cells[6][pin / 32U * GPIO_O_GPBDAT / 2U] >> pin % 32U & 1U;
}

uint32_t fake_reset_cause(void)
{
    fake_settle();
    return cause_left;
}

/* device.c: clocks, and the watchdog off */

void Device_init(void)
{
    EALLOW;
    HWREGH(WD_BASE + SYSCTL_O_WDCR) = SYSCTL_WDCR_WDDIS | SYSCTL_WD_CHKBITS;
    EDIS;
    SysCtl_setLowSpeedClock(SYSCTL_LSPCLK_PRESCALE_4);
}

void Device_initGPIO(void)
{
}

void fake_system_power_on(uint32_t reset_cause, uint32_t timer1_begins_at)
{
    uint32_t i;

#ifdef TI_REGISTERS
    fake_gpio_area.base = (uint32_t)(uintptr_t)cells[5];
    fake_pin_area.base = (uint32_t)(uintptr_t)cells[6];
#else
    fake_gpio_area.base = GPIOCTRL_BASE;
    fake_pin_area.base = GPIODATA_BASE;
#endif
    for (i = 0U; i < TIMERS; i++) {
        static const timer stopped = {0U, 0U, 0U, 0U};

        timers[i] = stopped;
        fake_show(&fake_timer_area, i * TIMER_WORDS + CPUTIMER_O_TCR, CPUTIMER_TCR_TSS);
    }
    timers[1].period = timer1_begins_at;
    bites = 0U;
    served = 0U;
    watchdog_since = 0U;
    key = 0U;
    cause_left = (uint16_t)reset_cause;
    show_cause(cause_left);
    fake_show(&fake_clock_area, 0U, SYSCTL_LSPCLK_PRESCALE_4);
    fake_show(&fake_watchdog_area, SYSCTL_O_WDKEY, FAKE_UNWRITTEN);
}
