/* What a test calls of the port and the fake together. */
#include "fake.h"

#include "f28_board.h"
#include "f28_run.h"
#include "f28_serial.h"
#include "f28_stack.h"
#include "f28_time.h"

volatile uint16_t f28_stack[F28_STACK_WORDS]; /* the linker's on the board */

void bench_passes(uint32_t cycles, uint32_t work);
void bench_run_line(uint32_t work);
uint32_t bench_stack_size(void);
void bench_software_reset(void);

/* Run the main loop for so many cycles; each pass has `work` cycles of its own besides its calls of driverlib. */
void bench_passes(uint32_t cycles, uint32_t work)
{
    const uint64_t end = fake_time() + cycles;

    while (fake_time() < end) {
        f28_pass();
        fake_run(work);
    }
}

/* Run the main loop until the line has brought everything. */
void bench_run_line(uint32_t work)
{
    while (fake_line_waits() > 0U) {
        f28_pass();
        fake_run(work);
    }
}

uint32_t bench_stack_size(void)
{
    return F28_STACK_WORDS;
}

void bench_software_reset(void)
{
    SCI_performSoftwareReset(SCIA_BASE);
}
