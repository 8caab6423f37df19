/* The estimator on the emulated Cortex-M4F: octets of events come through the mailbox, results go back as
 * filter_host.c's do, and at the end the costs in instructions: of the samples of the IMU, and of each part.
 */
#include "emulated_start.h"
#include "filter_steps.h"

static filter_steps all;
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
    uint32_t costs[FILTER_PARTS];
    uint32_t at;

    if (is_begun == 0U) {
        filter_steps_init(&all, fs_port_clock);
        is_begun = 1U;
    }
    mailbox->sent_length = 0U;
    mailbox->more = 0U;
    for (at = 0U; at < mailbox->received_length; at++) {
        if (filter_steps_push(&all, mailbox->received[at]) != 0U) {
            put_u32(mailbox, all.hash);
        }
    }
    if (mailbox->received_length == 0U) {
        put_u32(mailbox, filter_steps_hash(&all));
        put_u32(mailbox, all.samples);
        put_u32(mailbox, all.sum);
        put_u32(mailbox, all.most);
        put_u32(mailbox, all.least);
        filter_steps_costs(&all, costs);
        for (at = 0U; at < FILTER_PARTS; at++) {
            put_u32(mailbox, costs[at]);
        }
    }
}
