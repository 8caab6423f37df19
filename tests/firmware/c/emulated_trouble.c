/* What an emulated target may do wrong: the first octet it is given chooses. */
#include "emulated_start.h"

static uint32_t has_always_more;

void fs_emulated_serve(void)
{
    fs_mailbox *const mailbox = fs_port_mailbox();
    volatile uint32_t *place = (volatile uint32_t *)0x60000000UL; /* nothing is there */
    void (*volatile nowhere)(void) = 0;
    uint32_t first, second, third;
    volatile uint32_t forever = 1U;

    mailbox->sent_length = 0U;
    mailbox->more = has_always_more;
    switch (mailbox->received_length == 0U ? 0U : mailbox->received[0]) {
    case 'w':
        *place = 1U;
        break;
    case 'n':
        nowhere();
        break;
    case 'l':
        while (forever != 0U) {
        }
        break;
    case 'm':
        has_always_more = 1U;
        mailbox->more = 1U;
        break;
    case 'c': /* two readings next to each other, and two with seven instructions between them */
        first = fs_port_clock();
        second = fs_port_clock();
        __asm__ volatile("nop\n nop\n nop\n nop.w\n nop.w\n nop\n nop.w");
        third = fs_port_clock();
        mailbox->sent[0] = (unsigned char)(second - first);
        mailbox->sent[1] = (unsigned char)(third - second);
        mailbox->sent_length = 2U;
        break;
    default:
        mailbox->sent[0] = 'y';
        mailbox->sent_length = 1U;
        break;
    }
}
