/*
 * What the files of the simulated chip share. Driverlib reaches the chip through HWREGH and HWREG, which give it the cell
 * of a register. A cell holds what a read shows; a write is seen at the next access, as a cell that has changed. A register
 * that is only written therefore shows FAKE_UNWRITTEN, and one whose bits are cleared by writing 1 shows a bit that no
 * write has.
 */
#ifndef FAKE_CHIP_H
#define FAKE_CHIP_H

#include <stddef.h>

#include "fake.h"

#define FAKE_UNWRITTEN 0xFFFFU

/* Registers in a row, of 16 bits each. */
typedef struct {
    uint32_t base, size;
    uint16_t *cells, *shown;            /* as driverlib sees them; as the chip has shown them last */
    void (*written)(uint32_t offset);   /* the cell at this offset has changed; NULL: memory */
    uint16_t is_protected;              /* a write needs EALLOW */
} fake_area;

extern fake_area fake_timer_area, fake_pie_area, fake_vector_area, fake_watchdog_area, fake_sci_area, fake_clock_area,
    fake_cpu_area, fake_boot_area, fake_gpio_area, fake_pin_area;

/* Show a value in a register. */
void fake_show(fake_area *area, uint32_t offset, uint16_t value);
void fake_hold(fake_area *area); /* an address in these registers is given away */
void fake_settle(void); /* do what the writes since the last access ask for */
void fake_note(const char *misuse);
void fake_access(void); /* let the time of an access pass, in which interrupts may strike */

enum { FAKE_TIMER0, FAKE_RECEIVED, FAKE_SENT, FAKE_SOURCES }; /* sources of interrupts, in order of priority */
void fake_raise(uint16_t source);
void fake_strike(void); /* take the interrupts that are due */
uint16_t fake_in_interrupt(void);

/* Time: how long until something happens, `most` cycles at most; let that pass; bring the registers up to date. */
uint64_t fake_sci_next(uint64_t most);
void fake_sci_pass(void);
void fake_sci_show(uint32_t offset); /* a read of this register follows */
void fake_sci_strike(void);          /* raise the interrupts that the SCI has enabled */
uint64_t fake_system_next(uint64_t most);
void fake_system_pass(uint64_t cycles);
void fake_system_show(void);
uint32_t fake_lspclk_divider(void);

void fake_interrupts_power_on(void);
void fake_sci_power_on(uint16_t flags_are);
void fake_system_power_on(uint32_t reset_cause, uint32_t timer1_begins_at);

#endif
