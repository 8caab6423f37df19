/* UART 0 through its interrupts: two rings, each with one writer and one reader. */
#include "mps2_board.h"

#define RING 1024U /* octets, a power of two */
#define MASK (RING - 1U)
#define LEAST_DIVIDER 16U

typedef struct {
    volatile uint32_t written, read; /* free-running: their difference is what the ring holds */
    volatile unsigned char octets[RING];
} ring;

static ring received, to_send;
static volatile uint32_t overruns;

uint16_t mps2_uart_can_set_baud(uint32_t baud)
{
    const uint32_t divider = MPS2_CLOCK_HZ / baud;

    /* rounded down, the line runs too fast: by 2 % at most */
    return (divider >= LEAST_DIVIDER && MPS2_CLOCK_HZ - divider * baud <= divider * baud / 50U) ? 1U : 0U;
}

uint16_t mps2_uart_set_baud(uint32_t baud)
{
    if (to_send.written != to_send.read || (MPS2_UART0_STATE & MPS2_UART_STATE_SENDING) != 0U) {
        return 0U;
    }
    MPS2_UART0_DIVIDER = MPS2_CLOCK_HZ / baud;
    return 1U;
}

void mps2_uart_init(void)
{
    MPS2_UART0_DIVIDER = MPS2_CLOCK_HZ / MPS2_BAUD;
    MPS2_UART0_CONTROL =
        MPS2_UART_SEND | MPS2_UART_RECEIVE | MPS2_UART_SEND_INTERRUPT | MPS2_UART_RECEIVE_INTERRUPT;
    MPS2_NVIC_ENABLE = (1UL << MPS2_UART0_RECEIVE_IRQ) | (1UL << MPS2_UART0_SEND_IRQ);
}

void mps2_uart_receive_interrupt(void)
{
    MPS2_UART0_INTERRUPT = MPS2_UART_RECEIVE;
    if ((MPS2_UART0_STATE & MPS2_UART_STATE_OVERRUN) != 0U) {
        MPS2_UART0_STATE = MPS2_UART_STATE_OVERRUN;
        overruns = overruns + 1U;
    }
    while ((MPS2_UART0_STATE & MPS2_UART_STATE_RECEIVED) != 0U) {
        const unsigned char octet = (unsigned char)MPS2_UART0_DATA;

        if (received.written - received.read == RING) {
            overruns = overruns + 1U;
        } else {
            received.octets[received.written & MASK] = octet;
            received.written = received.written + 1U;
        }
    }
}

/* Hand the next octets to the UART; called by its interrupt, or with that interrupt off. */
static void send_more(void)
{
    while (to_send.written != to_send.read && (MPS2_UART0_STATE & MPS2_UART_STATE_SENDING) == 0U) {
        MPS2_UART0_DATA = to_send.octets[to_send.read & MASK];
        to_send.read = to_send.read + 1U;
    }
}

void mps2_uart_send_interrupt(void)
{
    MPS2_UART0_INTERRUPT = MPS2_UART_SEND;
    send_more();
}

int mps2_uart_take(void)
{
    int octet;

    if (received.written == received.read) {
        return -1;
    }
    octet = received.octets[received.read & MASK];
    received.read = received.read + 1U;
    return octet;
}

uint16_t mps2_uart_room(void)
{
    return (uint16_t)(RING - (to_send.written - to_send.read));
}

void mps2_uart_give(uint16_t octet)
{
    to_send.octets[to_send.written & MASK] = (unsigned char)octet;
    to_send.written = to_send.written + 1U;
    __asm__ volatile("cpsid i" : : : "memory");
    send_more();
    __asm__ volatile("cpsie i" : : : "memory");
}

uint32_t mps2_uart_overruns(void)
{
    return overruns;
}
