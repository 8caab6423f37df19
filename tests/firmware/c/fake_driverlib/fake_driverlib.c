/* See fake.h. Behaviour after SPRUHX5 (technical reference manual of the TMS320F2837xS) and driverlib's own sources. */
#include "fake.h"

#include <string.h>

#include "device.h"

#define FIFO 16U
#define LINE 65536U
#define WATCHDOG_CYCLES (256U * 512U * (FAKE_SYSCLK / 10000000U)) /* 256 counts of INTOSC1 / 512, unscaled */
#define STORM 1000U
#define SOURCES 3U /* timer 0, SCIA received, SCIA sent: in order of priority */

typedef struct {
    uint32_t period, count;
    uint16_t running, interrupt_on;
} timer;

typedef struct {
    uint16_t octets[FIFO], held;
} fifo;

typedef struct {
    void (*handler)(void);
    uint32_t number, taken;
    uint16_t group, enabled, pending;
} source;

static struct {
    uint64_t time;
    uint16_t flags_are, in_interrupt, masked, eallow, global_once;
    uint64_t masked_since, longest_masked;
    const char *misuse;
    uint32_t strike_every, calls;
    source sources[SOURCES];
    uint16_t ack; /* groups that wait for their acknowledgement */
    timer timers[2];
    /* SCIA */
    uint64_t bit_eighths; /* BRR + 1 */
    uint32_t lspclk_divider;
    fifo rx, tx;
    uint16_t rx_level, tx_level, rx_flag, tx_flag, rx_met, tx_met, rx_on, tx_on;
    uint16_t status, overflow, deaf, fifo_on, module_on;
    uint16_t stop_at_errors;
    uint16_t astray; /* bit of the octet before in which the receiver found a false start; 0: it is in step */
    uint16_t before; /* that octet, as the line brought it */
    uint16_t cut, cut_at; /* 1: a software reset hit the octet that is on the line, in this bit */
    uint16_t shifting, shift_busy, damaged;
    uint64_t shift_done, line_next;
    uint16_t line[LINE], sent[LINE];
    uint32_t line_first, line_end, sent_end, sent_taken;
    /* system */
    uint32_t cause, bites, served, pins[128];
    uint16_t watchdog_on, watchdog_prescale;
    uint64_t watchdog_since;
} chip;

static void misuse(const char *what)
{
    if (chip.misuse[0] == '\0') {
        chip.misuse = what;
    }
}

static void raise(uint16_t which)
{
    chip.sources[which].pending = 1U;
}

/* Follow the FIFO levels: set flags whose condition holds, and raise interrupts of flags that rose. */
static void follow_flags(void)
{
    const uint16_t rx_meets = chip.rx.held >= chip.rx_level, tx_meets = chip.tx.held <= chip.tx_level;

    if (rx_meets && !chip.rx_flag && (chip.flags_are == FAKE_LEVEL || !chip.rx_met)) {
        chip.rx_flag = 1U;
        if (chip.rx_on) {
            raise(1U);
        }
    }
    if (tx_meets && !chip.tx_flag && (chip.flags_are == FAKE_LEVEL || !chip.tx_met)) {
        chip.tx_flag = 1U;
        if (chip.tx_on) {
            raise(2U);
        }
    }
    chip.rx_met = rx_meets;
    chip.tx_met = tx_meets;
}

uint64_t fake_octet_cycles(void)
{
    return 10U * 8U * chip.bit_eighths * chip.lspclk_divider;
}

/* Return a bit of what the line brings: 0 the start bit, 1 to 8 the data, 9 the stop bit. */
static uint16_t line_bit(uint16_t what, uint32_t bit)
{
    if ((what & FAKE_PAUSE) != 0U) {
        return 1U;
    }
    if (bit == 0U) {
        return 0U;
    }
    if (bit == 9U) {
        return (what & FAKE_FRAMING) == 0U;
    }
    return (uint16_t)(what >> (bit - 1U)) & 1U;
}

/* The receiver looks for a start bit from this bit on; what it finds inside an octet leads it astray. */
static void look_for_start(uint16_t what, uint32_t bit)
{
    while (bit < 10U && line_bit(what, bit) != 0U) {
        bit++;
    }
    chip.astray = (bit < 10U) ? (uint16_t)bit : 0U;
    chip.before = what;
}

/* Return what a receiver that is astray makes of the octet before and this one, and let it look for the next start. */
static uint16_t false_octet(uint16_t what)
{
    const uint32_t start = chip.astray;
    uint32_t i, at, octet = 0U;

    for (i = 0U; i < 8U; i++) {
        at = start + 1U + i;
        octet |= (uint32_t)(at < 10U ? line_bit(chip.before, at) : line_bit(what, at - 10U)) << i;
    }
    if (line_bit(what, start - 1U) == 0U) {
        octet |= FAKE_FRAMING;
    }
    look_for_start(what, start);
    return (uint16_t)octet;
}

static void receive(uint16_t what)
{
    if (chip.cut) {
        chip.cut = 0U;
        look_for_start(what, chip.cut_at);
        return;
    }
    if (chip.astray != 0U && (what & FAKE_BREAK) == 0U) {
        what = false_octet(what);
    }
    if ((what & FAKE_PAUSE) != 0U || chip.deaf || !chip.module_on) {
        return;
    }
    if ((what & FAKE_BREAK) != 0U) {
        chip.status |= SCI_RXSTATUS_BREAK | SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_ERROR;
        chip.deaf = 1U;
        chip.astray = 0U;
        return;
    }
    if ((what & FAKE_OVERRUN) != 0U) {
        chip.status |= SCI_RXSTATUS_OVERRUN | SCI_RXSTATUS_ERROR;
        return;
    }
    if ((what & FAKE_FRAMING) != 0U) {
        chip.status |= SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_ERROR;
    }
    if (chip.rx.held == FIFO) { /* the oldest one is lost */
        chip.overflow = 1U;
        memmove(&chip.rx.octets[0], &chip.rx.octets[1], (FIFO - 1U) * sizeof chip.rx.octets[0]);
        chip.rx.held--;
    }
    chip.rx.octets[chip.rx.held++] = (what & 0xFFU) | ((what & FAKE_FRAMING) != 0U ? SCI_RXBUF_SCIFFFE : 0U);
    if ((what & FAKE_FRAMING) != 0U && chip.stop_at_errors) {
        chip.deaf = 1U;
        chip.astray = 0U;
    }
}

static void move_octets(void)
{
    if (chip.line_first != chip.line_end && chip.time >= chip.line_next) {
        receive(chip.line[chip.line_first++ % LINE]);
        chip.line_next += fake_octet_cycles();
    }
    if (chip.shift_busy && chip.time >= chip.shift_done) {
        chip.sent[chip.sent_end++ % LINE] = chip.damaged ? (uint16_t)(chip.shifting ^ 0x55U) : chip.shifting;
        chip.shift_busy = 0U;
    }
    if (!chip.shift_busy && chip.tx.held > 0U) {
        chip.shifting = chip.tx.octets[0];
        memmove(&chip.tx.octets[0], &chip.tx.octets[1], (FIFO - 1U) * sizeof chip.tx.octets[0]);
        chip.tx.held--;
        chip.shift_busy = 1U;
        chip.damaged = 0U;
        chip.shift_done = chip.time + fake_octet_cycles();
    }
    follow_flags();
}

/* Let time pass up to the next thing that happens, `most` cycles at most; returns how many. */
static uint32_t advance(uint32_t most)
{
    uint64_t step = most;
    uint16_t i;

    if (chip.line_first != chip.line_end && chip.line_next - chip.time < step) {
        step = chip.line_next - chip.time;
    }
    if (chip.shift_busy && chip.shift_done - chip.time < step) {
        step = chip.shift_done - chip.time;
    }
    for (i = 0U; i < 2U; i++) {
        if (chip.timers[i].running && (uint64_t)chip.timers[i].count + 1U < step) {
            step = (uint64_t)chip.timers[i].count + 1U;
        }
    }
    chip.time += step;
    for (i = 0U; i < 2U; i++) {
        timer *const t = &chip.timers[i];

        if (!t->running) {
            continue;
        }
        if (step > t->count) { /* step == count + 1: it was 0 and begins again */
            t->count = t->period;
            if (i == 0U && t->interrupt_on) {
                raise(0U);
            }
        } else {
            t->count -= (uint32_t)step;
        }
    }
    if (chip.watchdog_on && chip.time - chip.watchdog_since >= (WATCHDOG_CYCLES << (chip.watchdog_prescale - 1U))) {
        chip.bites++;
        chip.watchdog_since = chip.time;
    }
    move_octets();
    return (uint32_t)step;
}

static void strike(void)
{
    uint16_t i, in_a_row = 0U;

    for (i = 0U; i < SOURCES && !chip.in_interrupt && !chip.masked; i++) {
        source *const s = &chip.sources[i];

        if (s->pending && s->enabled && (chip.ack & s->group) == 0U) {
            s->pending = 0U;
            s->taken++;
            chip.ack |= s->group;
            chip.in_interrupt = 1U;
            s->handler();
            if (++in_a_row > STORM) { /* the processor would get to nothing else any more */
                misuse("interrupts without an end");
                return;
            }
            chip.in_interrupt = 0U;
            if ((chip.ack & s->group) != 0U) {
                misuse("an interrupt did not acknowledge its group");
            }
            i = (uint16_t)-1; /* from the first priority again */
        }
    }
}

void fake_run(uint32_t cycles)
{
    while (cycles > 0U) {
        cycles -= advance(cycles);
        strike();
    }
}

void fake_stop_at_errors(void)
{
    chip.stop_at_errors = 1U;
}

void fake_strike_every(uint32_t n)
{
    chip.strike_every = n;
    chip.calls = 0U;
}

static void call(void)
{
    if (chip.strike_every > 0U && !chip.in_interrupt && ++chip.calls >= chip.strike_every) {
        chip.calls = 0U;
        if (chip.rx_on) {
            raise(1U);
        }
        if (chip.tx_on) {
            raise(2U);
        }
    }
    fake_run(FAKE_CALL);
}

static void no_handler(void)
{
    misuse("an interrupt without a handler");
}

void fake_power_on(uint16_t flags_are, uint32_t reset_cause, uint32_t timer1_begins_at)
{
    static const source sources[SOURCES] = {
        {no_handler, INT_TIMER0, 0U, INTERRUPT_ACK_GROUP1, 0U, 0U},
        {no_handler, INT_SCIA_RX, 0U, INTERRUPT_ACK_GROUP9, 0U, 0U},
        {no_handler, INT_SCIA_TX, 0U, INTERRUPT_ACK_GROUP9, 0U, 0U},
    };

    memset(&chip, 0, sizeof chip);
    memcpy(chip.sources, sources, sizeof sources);
    chip.misuse = "";
    chip.flags_are = flags_are;
    chip.cause = reset_cause;
    chip.masked = 1U;
    chip.lspclk_divider = 4U;
    chip.bit_eighths = 1U;
    chip.rx_level = FIFO;
    chip.timers[1].period = timer1_begins_at;
    chip.watchdog_prescale = 1U;
    chip.watchdog_on = 1U; /* as after a reset, until Device_init */
}

uint64_t fake_time(void)
{
    return chip.time;
}

void fake_line(const uint16_t *octets, uint32_t count)
{
    uint32_t i;

    if (chip.line_first == chip.line_end) {
        chip.line_next = chip.time + fake_octet_cycles();
    }
    for (i = 0U; i < count; i++) {
        chip.line[chip.line_end++ % LINE] = octets[i];
    }
}

uint32_t fake_line_waits(void)
{
    return chip.line_end - chip.line_first;
}

uint32_t fake_sent(uint16_t *octets, uint32_t room)
{
    uint32_t n = 0U;

    while (n < room && chip.sent_taken != chip.sent_end) {
        octets[n++] = chip.sent[chip.sent_taken++ % LINE];
    }
    return n;
}

void fake_stop_timer0(void)
{
    chip.timers[0].running = 0U;
}

uint32_t fake_watchdog_bites(void)
{
    return chip.bites;
}

uint32_t fake_watchdog_served(void)
{
    return chip.served;
}

uint32_t fake_pin(uint32_t pin)
{
    return chip.pins[pin];
}

uint32_t fake_reset_cause(void)
{
    return chip.cause;
}

uint32_t fake_interrupts(uint32_t number)
{
    uint16_t i;

    for (i = 0U; i < SOURCES; i++) {
        if (chip.sources[i].number == number) {
            return chip.sources[i].taken;
        }
    }
    return 0U;
}

uint32_t fake_longest_masked(void)
{
    return (uint32_t)chip.longest_masked;
}

const char *fake_misuse(void)
{
    return chip.misuse;
}

void fake_eallow(void)
{
    chip.eallow = 1U;
}

void fake_edis(void)
{
    chip.eallow = 0U;
}

/* device.c */

void Device_init(void)
{
    call();
    chip.watchdog_on = 0U;
    chip.lspclk_divider = 4U;
}

void Device_initGPIO(void)
{
    call();
}

/* sci.c, sci.h */

static void is_scia(uint32_t base)
{
    call();
    if (base != SCIA_BASE) {
        misuse("not SCIA");
    }
}

void SCI_setConfig(uint32_t base, uint32_t lspclkHz, uint32_t baud, uint32_t config)
{
    is_scia(base);
    if (lspclkHz != FAKE_SYSCLK / chip.lspclk_divider) {
        misuse("SCI_setConfig is told a wrong LSPCLK");
    }
    if (config != 7U) {
        misuse("not 8N1");
    }
    chip.bit_eighths = lspclkHz / (baud * 8U); /* rounded down, as driverlib has it */
    chip.module_on = 1U;
}

void SCI_setFIFOInterruptLevel(uint32_t base, SCI_TxFIFOLevel txLevel, SCI_RxFIFOLevel rxLevel)
{
    is_scia(base);
    chip.tx_level = (uint16_t)txLevel;
    chip.rx_level = (uint16_t)rxLevel;
}

void SCI_enableFIFO(uint32_t base)
{
    is_scia(base);
    chip.fifo_on = 1U;
}

void SCI_enableModule(uint32_t base)
{
    is_scia(base);
    chip.module_on = 1U;
}

void SCI_resetChannels(uint32_t base)
{
    is_scia(base);
    chip.rx.held = 0U;
    chip.tx.held = 0U;
}

void SCI_resetRxFIFO(uint32_t base)
{
    is_scia(base);
    chip.rx.held = 0U;
}

void SCI_resetTxFIFO(uint32_t base)
{
    is_scia(base);
    chip.tx.held = 0U;
}

/* What a reset does to the octet on the line: nothing while it has brought but its start bit. */
static void cut_short(void)
{
    const uint64_t began = chip.line_next - fake_octet_cycles();
    const uint16_t what = chip.line[chip.line_first % LINE];

    if (chip.line_first == chip.line_end || chip.time < began || (what & (FAKE_PAUSE | FAKE_BREAK)) != 0U) {
        return;
    }
    chip.cut_at = (uint16_t)((chip.time - began) * 10U / fake_octet_cycles());
    chip.cut = chip.cut_at > 0U;
}

void SCI_performSoftwareReset(uint32_t base)
{
    is_scia(base);
    chip.astray = 0U;
    cut_short();
    chip.status = 0U;
    chip.deaf = 0U;
    chip.damaged = chip.shift_busy;
}

void SCI_enableInterrupt(uint32_t base, uint32_t intFlags)
{
    is_scia(base);
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        if (!chip.rx_on && chip.rx_flag && chip.flags_are == FAKE_LEVEL) {
            raise(1U);
        }
        chip.rx_on = 1U;
    }
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        if (!chip.tx_on && chip.tx_flag && chip.flags_are == FAKE_LEVEL) {
            raise(2U);
        }
        chip.tx_on = 1U;
    }
}

void SCI_disableInterrupt(uint32_t base, uint32_t intFlags)
{
    is_scia(base);
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        chip.rx_on = 0U;
    }
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        chip.tx_on = 0U;
    }
}

void SCI_clearInterruptStatus(uint32_t base, uint32_t intFlags)
{
    is_scia(base);
    if ((intFlags & ~(uint32_t)(SCI_INT_RXFF | SCI_INT_TXFF)) != 0U) {
        SCI_performSoftwareReset(base); /* so does driverlib */
    }
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        chip.rx_flag = 0U;
    }
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        chip.tx_flag = 0U;
    }
    follow_flags();
}

SCI_RxFIFOLevel SCI_getRxFIFOStatus(uint32_t base)
{
    is_scia(base);
    return (SCI_RxFIFOLevel)chip.rx.held;
}

SCI_TxFIFOLevel SCI_getTxFIFOStatus(uint32_t base)
{
    is_scia(base);
    return (SCI_TxFIFOLevel)chip.tx.held;
}

uint16_t SCI_getRxStatus(uint32_t base)
{
    is_scia(base);
    return chip.status;
}

uint16_t fake_register(uint32_t address)
{
    uint16_t octet;

    call();
    if (address != SCIA_BASE + SCI_O_RXBUF) {
        misuse("a register that the fake has not got");
        return 0U;
    }
    if (chip.rx.held == 0U) {
        misuse("read from an empty FIFO");
        return 0U;
    }
    octet = chip.rx.octets[0];
    memmove(&chip.rx.octets[0], &chip.rx.octets[1], (FIFO - 1U) * sizeof chip.rx.octets[0]);
    chip.rx.held--;
    follow_flags();
    return octet;
}

void SCI_writeCharNonBlocking(uint32_t base, uint16_t data)
{
    is_scia(base);
    if (chip.tx.held == FIFO || !chip.fifo_on) {
        misuse("wrote into a full FIFO");
        return;
    }
    if (data > 0xFFU) {
        misuse("sent an octet with high bits");
    }
    chip.tx.octets[chip.tx.held++] = data;
    move_octets();
}

bool SCI_getOverflowStatus(uint32_t base)
{
    is_scia(base);
    return chip.overflow != 0U;
}

void SCI_clearOverflowStatus(uint32_t base)
{
    is_scia(base);
    chip.overflow = 0U;
}

/* cputimer.h */

static timer *timer_of(uint32_t base)
{
    call();
    return &chip.timers[base == CPUTIMER0_BASE ? 0 : 1];
}

void CPUTimer_setPeriod(uint32_t base, uint32_t periodCount)
{
    timer_of(base)->period = periodCount;
}

void CPUTimer_setPreScaler(uint32_t base, uint16_t prescaler)
{
    (void)timer_of(base);
    if (prescaler != 0U) {
        misuse("the fake's timers have no prescaler");
    }
}

void CPUTimer_stopTimer(uint32_t base)
{
    timer_of(base)->running = 0U;
}

void CPUTimer_startTimer(uint32_t base)
{
    timer *const t = timer_of(base);

    t->count = t->period;
    t->running = 1U;
}

void CPUTimer_reloadTimerCounter(uint32_t base)
{
    timer *const t = timer_of(base);

    t->count = t->period;
}

void CPUTimer_clearOverflowFlag(uint32_t base)
{
    (void)timer_of(base);
}

void CPUTimer_enableInterrupt(uint32_t base)
{
    timer_of(base)->interrupt_on = 1U;
}

uint32_t CPUTimer_getTimerCount(uint32_t base)
{
    return timer_of(base)->count;
}

/* interrupt.h */

static source *source_of(uint32_t number)
{
    uint16_t i;

    call();
    for (i = 0U; i < SOURCES; i++) {
        if (chip.sources[i].number == number) {
            return &chip.sources[i];
        }
    }
    misuse("an interrupt that the fake has not got");
    return &chip.sources[0];
}

void Interrupt_initModule(void)
{
    uint16_t i;

    call();
    chip.masked = 1U;
    chip.ack = 0U;
    for (i = 0U; i < SOURCES; i++) {
        chip.sources[i].enabled = 0U;
        chip.sources[i].pending = 0U;
    }
}

void Interrupt_initVectorTable(void)
{
    uint16_t i;

    call();
    for (i = 0U; i < SOURCES; i++) {
        chip.sources[i].handler = no_handler;
    }
}

void Interrupt_register(uint32_t interruptNumber, void (*handler)(void))
{
    source_of(interruptNumber)->handler = handler;
}

void Interrupt_enable(uint32_t interruptNumber)
{
    source_of(interruptNumber)->enabled = 1U;
}

void Interrupt_clearACKGroup(uint16_t group)
{
    call();
    if (!chip.in_interrupt) {
        misuse("acknowledged outside an interrupt");
    }
    chip.ack &= (uint16_t)~group;
}

bool Interrupt_enableGlobal(void)
{
    const bool was_off = chip.masked != 0U;

    if (chip.in_interrupt) {
        misuse("enabled interrupts in an interrupt");
    }
    if (was_off && chip.global_once && chip.time - chip.masked_since > chip.longest_masked) {
        chip.longest_masked = chip.time - chip.masked_since;
    }
    chip.global_once = 1U;
    chip.masked = 0U;
    call();
    return was_off;
}

bool Interrupt_disableGlobal(void)
{
    const bool was_off = chip.masked != 0U;

    call();
    chip.masked = 1U;
    if (!was_off) {
        chip.masked_since = chip.time;
    }
    return was_off;
}

/* sysctl.h */

void SysCtl_setLowSpeedClock(SysCtl_LSPCLKPrescaler prescaler)
{
    call();
    chip.lspclk_divider = (prescaler == SYSCTL_LSPCLK_PRESCALE_1) ? 1U : 2U * (uint32_t)prescaler;
}

uint32_t SysCtl_getResetCause(void)
{
    call();
    return chip.cause;
}

void SysCtl_clearResetCause(uint32_t rstCauses)
{
    call();
    if (!chip.eallow) {
        misuse("cleared the reset cause without EALLOW");
    }
    chip.cause &= ~rstCauses;
}

void SysCtl_setWatchdogPrescaler(SysCtl_WDPrescaler prescaler)
{
    call();
    chip.watchdog_prescale = (uint16_t)prescaler;
}

void SysCtl_serviceWatchdog(void)
{
    call();
    chip.served++;
    chip.watchdog_since = chip.time;
}

void SysCtl_enableWatchdog(void)
{
    call();
    chip.watchdog_on = 1U;
}

/* gpio.c, gpio.h */

void GPIO_setPinConfig(uint32_t pinConfig)
{
    (void)pinConfig;
    call();
}

void GPIO_setPadConfig(uint32_t pin, uint32_t pinType)
{
    (void)pin;
    (void)pinType;
    call();
}

void GPIO_setDirectionMode(uint32_t pin, GPIO_Direction pinIO)
{
    (void)pin;
    (void)pinIO;
    call();
}

void GPIO_setQualificationMode(uint32_t pin, GPIO_QualificationMode qualification)
{
    (void)pin;
    (void)qualification;
    call();
}

void GPIO_writePin(uint32_t pin, uint32_t outVal)
{
    call();
    chip.pins[pin % 128U] = outVal;
}
