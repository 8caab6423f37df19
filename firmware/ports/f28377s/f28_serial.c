#include "f28_serial.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"
#include "fs_ring.h"
#include "f28_time.h"

#define FIFO_DEPTH 16U
#define DAMAGED (SCI_RXBUF_SCIFFFE | SCI_RXBUF_SCIFFPE) /* what the FIFO keeps beside an octet */
#define LASTING (SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_PARITY | SCI_RXSTATUS_OVERRUN) /* up until a software reset */

static volatile fs_octet receive_octets[F28_RECEIVE_RING], send_octets[F28_SEND_RING];
static fs_ring received, to_send;
static volatile uint32_t overruns, errors;
static volatile uint16_t heard; /* 1: octets came since the main loop last checked */
static uint16_t flags_seen;     /* the LASTING ones that were up when the main loop last checked */
static uint32_t silence_ms;     /* two octets at least, whatever the millisecond's phase */
static uint16_t has_left;       /* 1: nothing was left to send when the main loop last checked */
static uint32_t left_ms;        /* since then */
static uint32_t active_ms;      /* when the line was last seen busy, while one of them is up */

/* Empty the receive FIFO into the ring; called by its interrupt, or with interrupts off. */
static void fetch(void)
{
    uint16_t n;

    /* bounded by the size of the FIFO: a line without pauses cannot hold the loop here */
    for (n = 0U; n < FIFO_DEPTH && SCI_getRxFIFOStatus(SCIA_BASE) != SCI_FIFO_RX0; n++) {
        /* driverlib's own reads drop the two bits that belong to this octet, and the flags of SCIRXST to none */
        const uint16_t word = HWREGH(SCIA_BASE + SCI_O_RXBUF);

        heard = 1U;
        if ((word & DAMAGED) != 0U) {
            errors = errors + 1UL;
        }
        if (fs_ring_put(&received, word & 0xFFU) == 0U) {
            overruns = overruns + 1UL;
        }
    }
    if (SCI_getOverflowStatus(SCIA_BASE)) {
        overruns = overruns + 1UL; /* at least one octet is lost; the hardware does not count them */
        SCI_clearOverflowStatus(SCIA_BASE);
    }
}

/* Fill the transmit FIFO from the ring; called by its interrupt, or with interrupts off. */
static void feed(void)
{
    fs_octet octet;
    uint16_t n;

    for (n = 0U; n < FIFO_DEPTH && SCI_getTxFIFOStatus(SCIA_BASE) != SCI_FIFO_TX16; n++) {
        if (fs_ring_take(&to_send, &octet) == 0U) {
            break;
        }
        SCI_writeCharNonBlocking(SCIA_BASE, octet);
    }
    /* cleared after the FIFO was filled: the flag rises again when it runs low, whether by level or by edge */
    SCI_clearInterruptStatus(SCIA_BASE, SCI_INT_TXFF);
    if (fs_ring_held(&to_send) == 0U) {
        SCI_disableInterrupt(SCIA_BASE, SCI_INT_TXFF);
    } else {
        SCI_enableInterrupt(SCIA_BASE, SCI_INT_TXFF);
    }
}

static __interrupt void on_received(void)
{
    const uint32_t began = f28_interrupt_begins();

    fetch();
    SCI_clearInterruptStatus(SCIA_BASE, SCI_INT_RXFF);
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP9);
    f28_interrupt_ends(began);
}

static __interrupt void on_sent(void)
{
    const uint32_t began = f28_interrupt_begins();

    feed();
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP9);
    f28_interrupt_ends(began);
}

static void init_pins(void)
{
    GPIO_setPinConfig(DEVICE_GPIO_CFG_SCIRXDA);
    GPIO_setDirectionMode(DEVICE_GPIO_PIN_SCIRXDA, GPIO_DIR_MODE_IN);
    GPIO_setPadConfig(DEVICE_GPIO_PIN_SCIRXDA, GPIO_PIN_TYPE_PULLUP); /* a cable that is off reads as silence */
    GPIO_setQualificationMode(DEVICE_GPIO_PIN_SCIRXDA, GPIO_QUAL_ASYNC);
    GPIO_setPinConfig(DEVICE_GPIO_CFG_SCITXDA);
    GPIO_setDirectionMode(DEVICE_GPIO_PIN_SCITXDA, GPIO_DIR_MODE_OUT);
    GPIO_setPadConfig(DEVICE_GPIO_PIN_SCITXDA, GPIO_PIN_TYPE_STD);
    GPIO_setQualificationMode(DEVICE_GPIO_PIN_SCITXDA, GPIO_QUAL_ASYNC);
}

/* SCI_setConfig switches the FIFOs off. */
static void set_rate(uint32_t baud)
{
    SCI_setConfig(SCIA_BASE, F28_LSPCLK_HZ, baud, SCI_CONFIG_WLEN_8); /* one stop bit, no parity: both are 0 */
    SCI_enableFIFO(SCIA_BASE);
    silence_ms = 2UL + 20000UL / baud;
}

void f28_serial_init(void)
{
    fs_ring_init(&received, receive_octets, F28_RECEIVE_RING);
    fs_ring_init(&to_send, send_octets, F28_SEND_RING);
    overruns = 0UL;
    errors = 0UL;
    heard = 0U;
    flags_seen = 0U;
    active_ms = 0UL;
    has_left = 0U;
    left_ms = 0UL;
    init_pins();
    SCI_performSoftwareReset(SCIA_BASE);
    set_rate(F28_BAUD);
    SCI_resetChannels(SCIA_BASE);
    SCI_resetRxFIFO(SCIA_BASE);
    SCI_resetTxFIFO(SCIA_BASE);
    SCI_setFIFOInterruptLevel(SCIA_BASE, SCI_FIFO_TX4, SCI_FIFO_RX8);
    SCI_clearOverflowStatus(SCIA_BASE);
    SCI_clearInterruptStatus(SCIA_BASE, SCI_INT_TXFF | SCI_INT_RXFF);
    SCI_enableModule(SCIA_BASE);
    SCI_performSoftwareReset(SCIA_BASE);
    Interrupt_register(INT_SCIA_RX, &on_received);
    Interrupt_register(INT_SCIA_TX, &on_sent);
    SCI_enableInterrupt(SCIA_BASE, SCI_INT_RXFF);
    Interrupt_enable(INT_SCIA_RX);
    Interrupt_enable(INT_SCIA_TX);
}

/* Count an overrun when its flag rises; return 1 if a flag is up, and both directions have been silent since. */
static uint16_t flags_may_be_lowered(uint16_t status, uint32_t now_ms)
{
    if ((status & SCI_RXSTATUS_OVERRUN) != 0U && (flags_seen & SCI_RXSTATUS_OVERRUN) == 0U) {
        overruns = overruns + 1UL;
    }
    if (flags_seen == 0U) {
        active_ms = now_ms;
    }
    flags_seen = status & LASTING;
    if (flags_seen == 0U) {
        return 0U;
    }
    if (heard != 0U || fs_ring_held(&to_send) != 0U || SCI_getTxFIFOStatus(SCIA_BASE) != SCI_FIFO_TX0) {
        heard = 0U;
        active_ms = now_ms;
    }
    return (now_ms - active_ms >= silence_ms) ? 1U : 0U;
}

/*
 * A software reset begins the receiver anew in the midst of whatever is on the line: it loses the octet in flight, may
 * take a data bit of the next one for a start bit, and damages an octet that is just being sent. It is done at once
 * after a break, since the SCI receives nothing more until then. The flags of other errors are lowered by it alone as
 * well, but the SCI goes on under them, and the FIFO tells which octets are damaged: they wait for silence. Should a
 * chip stop there against what its manual says, there is silence soon.
 */
void f28_serial_service(void)
{
    const uint32_t now_ms = f28_now_ms();
    uint16_t status;

    (void)Interrupt_disableGlobal();
    status = SCI_getRxStatus(SCIA_BASE);
    fetch();
    if ((status & SCI_RXSTATUS_BREAK) != 0U) {
        errors = errors + 1UL;
    }
    if (flags_may_be_lowered(status, now_ms) != 0U || (status & SCI_RXSTATUS_BREAK) != 0U) {
        SCI_performSoftwareReset(SCIA_BASE);
        flags_seen = 0U;
    }
    (void)Interrupt_enableGlobal();
}

uint16_t f28_serial_take(fs_octet *out, uint16_t room)
{
    uint16_t n = 0U;

    while (n < room && fs_ring_take(&received, &out[n]) != 0U) {
        n++;
    }
    return n;
}

uint16_t f28_serial_room(void)
{
    return fs_ring_room(&to_send);
}

uint16_t f28_serial_give(const fs_octet *octets, uint16_t count)
{
    uint16_t n = 0U;

    while (n < count && fs_ring_put(&to_send, octets[n]) != 0U) {
        n++;
    }
    if (fs_ring_held(&to_send) != 0U) { /* also when nothing was given: an interrupt that was missed costs one pass */
        (void)Interrupt_disableGlobal();
        feed();
        (void)Interrupt_enableGlobal();
    }
    return n;
}

uint16_t f28_serial_can_set_baud(uint32_t baud)
{
    const uint32_t eighths = F28_LSPCLK_HZ / 8UL / baud;

    /* rounded down, the line runs too fast: by 2 % at most */
    return (eighths >= 2UL && F28_LSPCLK_HZ / 8UL - eighths * baud <= eighths * baud / 50UL) ? 1U : 0U;
}

/* The FIFO is empty when its last octet goes into the shift register, so the time of two octets is waited for. */
static uint16_t everything_left(void)
{
    const uint32_t now_ms = f28_now_ms();

    if (fs_ring_held(&to_send) != 0U || SCI_getTxFIFOStatus(SCIA_BASE) != SCI_FIFO_TX0) {
        has_left = 0U;
        return 0U;
    }
    if (has_left == 0U) {
        has_left = 1U;
        left_ms = now_ms;
    }
    return (now_ms - left_ms >= silence_ms) ? 1U : 0U;
}

uint16_t f28_serial_set_baud(uint32_t baud)
{
    if (everything_left() == 0U) {
        return 0U;
    }
    has_left = 0U;
    (void)Interrupt_disableGlobal();
    set_rate(baud);
    SCI_resetRxFIFO(SCIA_BASE); /* what came meanwhile came at the former rate */
    SCI_performSoftwareReset(SCIA_BASE);
    flags_seen = 0U;
    (void)Interrupt_enableGlobal();
    return 1U;
}

uint32_t f28_serial_overruns(void)
{
    uint32_t first, second;

    do { /* an interrupt may count between the two halves of the number */
        first = overruns;
        second = overruns;
    } while (first != second);
    return first;
}

uint32_t f28_serial_errors(void)
{
    uint32_t first, second;

    do { /* as above */
        first = errors;
        second = errors;
    } while (first != second);
    return first;
}
