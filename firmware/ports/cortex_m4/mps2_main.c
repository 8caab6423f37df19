/* The application as a full image for QEMU's machine mps2-an386: reset, interrupts, UART, files of the host.
 *
 * The command line tells what it speaks through:
 *   files IN OUT   octets from one file of the host to another by semihosting (pipes, too), under -icount shift=10, so
 *                  that costs are instructions and repeat exactly. It ends when IN ends.
 *   anything else  UART 0 through its interrupts; costs are nanoseconds of the emulator's clock. It never ends.
 */
#include "fs_app.h"
#include "fs_build.h"
#include "mps2_board.h"
#include "semihosting.h"

#define CHUNK 256U
#define NAME_ROOM 128U
#define NANOSECONDS_PER_INSTRUCTION 1024U
#define NANOSECONDS_PER_MILLISECOND 1000000U

static const fs_octet source_hash[8] = {FS_SOURCE_HASH};
static fs_port port;
static fs_app app;
static char command_line[2U * NAME_ROOM];

/* Cut the next word off a text: ends it with NUL and returns what follows it. */
static char *next_word(char *text)
{
    while (*text != '\0' && *text != ' ') {
        text++;
    }
    if (*text == ' ') {
        *text++ = '\0';
    }
    return text;
}

static uint16_t is_same(const char *left, const char *right)
{
    while (*left != '\0' && *left == *right) {
        left++;
        right++;
    }
    return (*left == *right) ? 1U : 0U;
}

static void begin(fs_clock clock, uint16_t unit)
{
    port.clock = clock;
    port.cost_unit = unit;
    port.board = "QEMU mps2-an386";
    port.compiler = FS_COMPILER;
    port.source_hash = source_hash;
    port.stack_size = mps2_stack_size();
    port.stack_high_water = mps2_stack_high_water;
    fs_app_init(&app, &port);
}

/* Write what the application has to send to a file; 0 when that fails. */
static uint16_t send_to(int32_t file)
{
    fs_octet octets[CHUNK];
    unsigned char plain[CHUNK];
    uint16_t count = fs_app_transmit(&app, octets, CHUNK);

    while (count != 0U) {
        uint16_t i;

        for (i = 0U; i < count; i++) {
            plain[i] = (unsigned char)octets[i];
        }
        if (semihosting_write(file, plain, count) == 0U) {
            return 0U;
        }
        count = fs_app_transmit(&app, octets, CHUNK);
    }
    return 1U;
}

/* Time under -icount: so many milliseconds as instructions have been executed, wherever the host waited. */
static uint32_t counted_ms(void)
{
    return mps2_instructions() / (NANOSECONDS_PER_MILLISECOND / NANOSECONDS_PER_INSTRUCTION);
}

static int serve_files(const char *in, const char *out)
{
    const int32_t input = semihosting_open(in, SEMIHOSTING_READ_BINARY);
    const int32_t output = semihosting_open(out, SEMIHOSTING_WRITE_BINARY);
    unsigned char octets[CHUNK];
    uint32_t count;

    if (input < 0 || output < 0) {
        return 1;
    }
    begin(mps2_instructions, FS_COST_INSTRUCTIONS);
    while ((count = semihosting_read(input, octets, CHUNK)) != 0U) {
        uint32_t i;

        fs_app_poll(&app, counted_ms());
        for (i = 0U; i < count; i++) {
            fs_app_receive(&app, octets[i]);
        }
        if (send_to(output) == 0U) {
            return 1;
        }
    }
    return 0;
}

static void serve_uart(void)
{
    fs_octet octets[CHUNK];

    port.baud = MPS2_BAUD;
    port.can_set_baud = mps2_uart_can_set_baud;
    port.set_baud = mps2_uart_set_baud;
    begin(mps2_nanoseconds, FS_COST_NANOSECONDS);
    mps2_tick_init();
    mps2_uart_init();
    for (;;) {
        int octet = mps2_uart_take();
        uint16_t room, count, i;

        fs_app_run(&app, mps2_microseconds());
        for (; octet >= 0; octet = mps2_uart_take()) {
            fs_app_receive(&app, (fs_octet)octet);
        }
        fs_app_uart_errors(&app, mps2_uart_overruns(), 0U);
        fs_app_poll(&app, mps2_now_ms());
        room = mps2_uart_room();
        count = fs_app_transmit(&app, octets, (room < CHUNK) ? room : CHUNK);
        for (i = 0U; i < count; i++) {
            mps2_uart_give(octets[i]);
        }
        __asm__ volatile("wfi"); /* SysTick wakes it at the latest */
    }
}

int main(void)
{
    char *in, *out;

    mps2_time_init();
    if (semihosting_command_line(command_line, sizeof command_line) == 0U) {
        return 1;
    }
    in = next_word(command_line);
    out = next_word(in);
    (void)next_word(out);
    if (is_same(command_line, "files")) {
        return serve_files(in, out);
    }
    serve_uart();
    return 0;
}
