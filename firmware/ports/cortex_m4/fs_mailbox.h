/* The mailbox through which the emulator and the emulated Cortex-M4F exchange octets and time.
 *
 * It is host memory that the emulator maps at FS_MAILBOX_ADDRESS, so an exchange costs no copy through the
 * emulator's interface: the host fills `received`, sets `received_length` and `now_ms`, runs the target from
 * fs_emulated_exchange to fs_emulated_stop, and finds the answer in `sent`.
 * flightstack/firmware/emulator.py lays out the same fields.
 */
#ifndef FS_MAILBOX_H
#define FS_MAILBOX_H

#include <stdint.h>

#define FS_MAILBOX_ADDRESS 0x40000000UL
#define FS_MAILBOX_RECEIVED 4096U
#define FS_MAILBOX_SENT 12288U

typedef struct {
    uint32_t instructions;    /* executed so far, modulo 2^32; counted by the emulator */
    uint32_t now_ms;          /* time of the target, given by the host */
    uint32_t received_length; /* octets in `received`, given by the host */
    uint32_t sent_length;     /* octets in `sent`, given by the target */
    uint32_t more;            /* 1 while the target has more to send than `sent` could hold */
    uint32_t reserved[3];
    unsigned char received[FS_MAILBOX_RECEIVED];
    unsigned char sent[FS_MAILBOX_SENT];
} fs_mailbox;

#endif
