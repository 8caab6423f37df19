/* The application on the emulated Cortex-M4F: one exchange reads input, advances time and sends output. */
#include "emulated_start.h"
#include "fs_app.h"
#include "fs_build.h"
#include "fs_sensing.h"

#define CHUNK 64U /* octets received or sent before the other direction has its turn */

/* from the linker script: only their addresses mean something */
extern uint32_t fs_stack_bottom[], fs_stack_top[];

static const fs_octet source_hash[8] = {FS_SOURCE_HASH};
static fs_port port;
static fs_app app;
static uint32_t is_begun;

/* the emulator has filled the stack with this before the start */
#define PAINT 0xA5A5A5A5UL

static uint32_t stack_high_water(void)
{
    const uint32_t *at = fs_stack_bottom;

    while (at < fs_stack_top && *at == PAINT) {
        at++;
    }
    return (uint32_t)(fs_stack_top - at) * 4U;
}

static void begin(void)
{
    port.clock = fs_port_clock;
    port.cost_unit = FS_COST_INSTRUCTIONS;
    port.board = "emulated Cortex-M4F";
    port.compiler = FS_COMPILER;
    port.source_hash = source_hash;
    port.stack_size = (uint32_t)(fs_stack_top - fs_stack_bottom) * 4U;
    port.stack_high_water = stack_high_water;
    port.sense = fs_sensing_take;
    port.read_estimator = fs_sensing_read;
    fs_app_init(&app, &port);
    is_begun = 1U;
}

/* Move what the application has to send into the mailbox; return 0 when there is no room for all of it. */
static uint32_t send(fs_mailbox *mailbox)
{
    fs_octet octets[CHUNK];
    uint16_t count;

    do {
        uint16_t i;

        if (FS_MAILBOX_SENT - mailbox->sent_length < CHUNK) {
            return 0U;
        }
        count = fs_app_transmit(&app, octets, CHUNK);
        for (i = 0U; i < count; i++) {
            mailbox->sent[mailbox->sent_length + i] = (unsigned char)octets[i];
        }
        mailbox->sent_length += count;
    } while (count != 0U);
    return 1U;
}

void fs_emulated_serve(void)
{
    fs_mailbox *const mailbox = fs_port_mailbox();
    uint32_t at;

    if (is_begun == 0U) {
        begin();
    }
    mailbox->sent_length = 0U;
    fs_app_poll(&app, mailbox->now_ms);
    for (at = 0U; at < mailbox->received_length; at++) {
        fs_app_receive(&app, mailbox->received[at]);
        if (at % CHUNK == CHUNK - 1U) {
            (void)send(mailbox);
        }
    }
    mailbox->more = 1U - send(mailbox);
}
