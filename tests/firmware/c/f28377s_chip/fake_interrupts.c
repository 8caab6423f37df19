/* The interrupt controller of the simulated chip: PIE, the processor's IER and INTM, the table of vectors. */
#include "fake_chip.h"

#define STORM 1000U
#define VECTORS 224U
#define PIE_WORDS (PIE_O_IFR12 + 1U)

typedef struct {
    const uint32_t number;
    uint32_t taken;
} source;

static source sources[FAKE_SOURCES] = {{INT_TIMER0, 0U}, {INT_SCIA_RX, 0U}, {INT_SCIA_TX, 0U}};
static uint16_t in_interrupt, masked, ack, global_once; /* ack: groups that wait for their acknowledgement */
static uint64_t masked_since, longest_masked;
volatile uint16_t IER, IFR;

static uint16_t pie_cells[PIE_WORDS], pie_shown[PIE_WORDS];
static uint32_t vectors[VECTORS], vectors_shown[VECTORS];
static void pie_written(uint32_t offset);
fake_area fake_pie_area = {PIECTRL_BASE, PIE_WORDS, pie_cells, pie_shown, pie_written, 0U};
fake_area fake_vector_area = {PIEVECTTABLE_BASE, 2U * VECTORS, (uint16_t *)vectors, (uint16_t *)vectors_shown, NULL, 1U};

static void pie_written(uint32_t offset)
{
    if (offset == PIE_O_ACK) {
        if (!in_interrupt) {
            fake_note("acknowledged outside an interrupt");
        }
        ack &= (uint16_t)~pie_cells[PIE_O_ACK];
        fake_show(&fake_pie_area, PIE_O_ACK, FAKE_UNWRITTEN);
    }
}

static uint32_t group_of(const source *s)
{
    return (s->number >> 8U & 0xFFU) - 1U;
}

static uint16_t bit_of(const source *s)
{
    return (uint16_t)(1U << ((s->number & 0xFFU) - 1U));
}

void fake_raise(uint16_t which)
{
    const uint32_t at = PIE_O_IFR1 + 2U * group_of(&sources[which]);

    fake_show(&fake_pie_area, at, pie_cells[at] | bit_of(&sources[which]));
}

static uint16_t is_due(const source *s)
{
    const uint32_t group = group_of(s);
    const uint16_t enabled = pie_cells[PIE_O_IER1 + 2U * group] & pie_cells[PIE_O_IFR1 + 2U * group];

    return (pie_cells[PIE_O_CTRL] & PIE_CTRL_ENPIE) != 0U && (enabled & bit_of(s)) != 0U &&
           ((IER & (uint16_t)~ack) >> group & 1U) != 0U;
}

/* The table has the lower 32 bits of an address. */
static void call_handler(const source *s)
{
    const uintptr_t here = (uintptr_t)&call_handler;
    const int32_t apart = (int32_t)(vectors[s->number >> 16U] - (uint32_t)here);

    ((void (*)(void))(here + (uintptr_t)(intptr_t)apart))();
}

static void take(source *s)
{
    const uint32_t group = group_of(s), at = PIE_O_IFR1 + 2U * group;

    fake_show(&fake_pie_area, at, pie_cells[at] & (uint16_t)~bit_of(s));
    s->taken++;
    ack |= (uint16_t)(1U << group);
    in_interrupt = 1U;
    call_handler(s);
    fake_settle();
    in_interrupt = 0U;
    if ((ack >> group & 1U) != 0U) {
        fake_note("an interrupt did not acknowledge its group");
    }
}

void fake_strike(void)
{
    uint16_t i, in_a_row = 0U;

    for (i = 0U; i < FAKE_SOURCES && !in_interrupt && !masked; i++) {
        if (is_due(&sources[i])) {
            take(&sources[i]);
            if (++in_a_row > STORM) { /* the processor would get to nothing else any more */
                fake_note("interrupts without an end");
                in_interrupt = 1U;
                return;
            }
            i = (uint16_t)-1; /* from the first priority again */
        }
    }
}

uint16_t fake_in_interrupt(void)
{
    return in_interrupt;
}

uint16_t __enable_interrupts(void)
{
    const uint16_t was_off = masked;

    if (in_interrupt) {
        fake_note("enabled interrupts in an interrupt");
    }
    if (was_off && global_once && fake_time() - masked_since > longest_masked) {
        longest_masked = fake_time() - masked_since;
    }
    global_once = 1U;
    masked = 0U;
    fake_access();
    return was_off;
}

uint16_t __disable_interrupts(void)
{
    const uint16_t was_off = masked;

    fake_access();
    masked = 1U;
    if (!was_off) {
        masked_since = fake_time();
    }
    return was_off;
}

uint32_t fake_interrupts(uint32_t number)
{
    uint16_t i;

    for (i = 0U; i < FAKE_SOURCES; i++) {
        if (sources[i].number == number) {
            return sources[i].taken;
        }
    }
    return 0U;
}

uint32_t fake_longest_masked(void)
{
    return (uint32_t)longest_masked;
}

void fake_interrupts_power_on(void)
{
    uint16_t i;

    for (i = 0U; i < FAKE_SOURCES; i++) {
        sources[i].taken = 0U;
    }
    in_interrupt = 0U;
    masked = 1U;
    ack = 0U;
    global_once = 0U;
    masked_since = 0U;
    longest_masked = 0U;
    IER = 0U;
    IFR = 0U;
    fake_show(&fake_pie_area, PIE_O_ACK, FAKE_UNWRITTEN);
}
