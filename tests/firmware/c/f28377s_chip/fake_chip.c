/* Time and registers of the simulated chip: see fake.h, fake_chip.h. */
#include "fake_chip.h"

#include <string.h>

#define AREAS 10U
#define HELD 4U /* registers that an expression of the port may hold the addresses of, and write later */

static fake_area *const areas[AREAS] = {
    &fake_timer_area, &fake_pie_area, &fake_vector_area, &fake_watchdog_area, &fake_sci_area,
    &fake_clock_area, &fake_cpu_area, &fake_boot_area, &fake_gpio_area, &fake_pin_area,
};
static fake_area *held[2][HELD]; /* outside an interrupt, in one */
static uint32_t holds[2];
static uint64_t now;
static const char *first_misuse;
static uint16_t eallow;
static uint32_t strike_every, accesses;

void fake_note(const char *misuse)
{
    if (first_misuse[0] == '\0') {
        first_misuse = misuse;
    }
}

const char *fake_misuse(void)
{
    fake_settle();
    return first_misuse;
}

uint64_t fake_time(void)
{
    return now;
}

void fake_show(fake_area *area, uint32_t offset, uint16_t value)
{
    area->cells[offset] = value;
    area->shown[offset] = value;
}

static void settle_area(fake_area *area)
{
    uint32_t i;

    if (memcmp(area->cells, area->shown, area->size * sizeof area->cells[0]) == 0) {
        return;
    }
    if (area->is_protected && !eallow) {
        fake_note("a protected register was written without EALLOW");
    }
    for (i = 0U; i < area->size; i++) {
        if (area->cells[i] != area->shown[i]) {
            area->shown[i] = area->cells[i];
            if (area->written != NULL) {
                area->written(i);
            }
        }
    }
}

/* Take in what was written: only registers that were reached lately can have been. */
void fake_settle(void)
{
    const uint16_t level = fake_in_interrupt();
    uint32_t i;

    for (i = 0U; i < HELD; i++) {
        if (held[level][i] != NULL) {
            settle_area(held[level][i]);
        }
    }
}

void fake_hold(fake_area *area)
{
    if (area != &fake_vector_area) { /* large, and only read when an interrupt strikes */
        const uint16_t level = fake_in_interrupt();

        held[level][holds[level]++ % HELD] = area;
    }
}

void fake_run(uint32_t cycles)
{
    fake_settle();
    while (cycles > 0U) {
        const uint64_t step = fake_sci_next(fake_system_next(cycles));

        now += step;
        cycles -= (uint32_t)step;
        fake_system_pass(step);
        fake_sci_pass();
        fake_strike();
    }
}

void fake_strike_every(uint32_t n)
{
    strike_every = n;
    accesses = 0U;
}

void fake_access(void)
{
    if (strike_every > 0U && !fake_in_interrupt() && ++accesses >= strike_every) {
        accesses = 0U;
        fake_sci_strike();
    }
    fake_run(FAKE_ACCESS);
}

static uint16_t *cell_of(uint32_t address)
{
    static uint16_t nothing[2];
    uint32_t i;

    fake_access();
    fake_system_show();
    for (i = 0U; i < AREAS; i++) {
        const uint32_t offset = address - areas[i]->base;

        if (offset < areas[i]->size) {
            if (areas[i] == &fake_sci_area) {
                fake_sci_show(offset);
            }
            fake_hold(areas[i]);
            return &areas[i]->cells[offset];
        }
    }
    fake_note("a register that the simulated chip has not got");
    return nothing;
}

volatile uint16_t *fake_at16(uint32_t address)
{
    return cell_of(address);
}

volatile uint32_t *fake_at32(uint32_t address)
{
    return (volatile uint32_t *)(void *)cell_of(address); /* the lower half first, on the chip as here */
}

void __eallow(void)
{
    fake_settle();
    eallow = 1U;
}

void __edis(void)
{
    fake_settle();
    eallow = 0U;
}

void fake_wait(void)
{
    fake_run(70U); /* RPT #69 || NOP */
}

void fake_power_on(uint16_t flags_are, uint32_t reset_cause, uint32_t timer1_begins_at)
{
    uint32_t i;

    now = 0U;
    first_misuse = "";
    eallow = 0U;
    fake_strike_every(0U);
    for (i = 0U; i < AREAS; i++) {
        memset(areas[i]->cells, 0, areas[i]->size * sizeof areas[i]->cells[0]);
        memset(areas[i]->shown, 0, areas[i]->size * sizeof areas[i]->cells[0]);
    }
    fake_interrupts_power_on();
    fake_sci_power_on(flags_are);
    fake_system_power_on(reset_cause, timer1_begins_at);
}
