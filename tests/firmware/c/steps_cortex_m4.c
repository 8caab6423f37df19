/* The steps on the emulated Cortex-M4F: octets come through the mailbox, results go back as
 * steps_avr.c's do, and at the end the largest number of instructions of each stage and their sums.
 */
#include "emulated_start.h"
#include "steps.h"

static steps all;
static uint32_t is_begun;

static void put_u32(fs_mailbox *mailbox, uint32_t value)
{
    uint16_t i;

    for (i = 0U; i < 4U; i++) {
        mailbox->sent[mailbox->sent_length++] = (unsigned char)((value >> (8U * i)) & 0xFFU);
    }
}

void fs_emulated_serve(void)
{
    fs_mailbox *const mailbox = fs_port_mailbox();
    uint32_t at;

    if (is_begun == 0U) {
        steps_init(&all, fs_port_clock);
        is_begun = 1U;
    }
    mailbox->sent_length = 0U;
    mailbox->more = 0U;
    for (at = 0U; at < mailbox->received_length; at++) {
        if (steps_push(&all, (fs_octet)(mailbox->received[at] | 0xC300U)) != 0U) {
            put_u32(mailbox, all.hash);
        }
    }
    if (mailbox->received_length == 0U) {
        put_u32(mailbox, all.refused);
        put_u32(mailbox, all.most.outer);
        put_u32(mailbox, all.most.inner);
        put_u32(mailbox, all.most.mixer);
        put_u32(mailbox, all.most.whole);
        put_u32(mailbox, all.sum.outer);
        put_u32(mailbox, all.sum.inner);
        put_u32(mailbox, all.sum.mixer);
        put_u32(mailbox, all.sum.whole);
    }
}
