#include "f28_serial.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"
#include "f28_ring.h"

#define FIFO_DEPTH 16U
#define LINE_ERRORS (SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_PARITY | SCI_RXSTATUS_BREAK)

static volatile fs_octet receive_octets[F28_RECEIVE_RING], send_octets[F28_SEND_RING];
static f28_ring received, to_send;
static volatile uint32_t overruns;
static uint32_t errors;

/* Empty the receive FIFO into the ring; called by its interrupt, or with interrupts off. */
static void fetch(void)
{
    uint16_t n;

    /* bounded by what the FIFO can hold: a line that never pauses keeps nobody here */
    for (n = 0U; n < FIFO_DEPTH && SCI_getRxFIFOStatus(SCIA_BASE) != SCI_FIFO_RX0; n++) {
        if (f28_ring_put(&received, SCI_readCharNonBlocking(SCIA_BASE)) == 0U) {
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
        if (f28_ring_take(&to_send, &octet) == 0U) {
            break;
        }
        SCI_writeCharNonBlocking(SCIA_BASE, octet);
    }
    /* cleared after the FIFO was filled: the flag rises again when it runs low, whether by level or by edge */
    SCI_clearInterruptStatus(SCIA_BASE, SCI_INT_TXFF);
    if (f28_ring_held(&to_send) == 0U) {
        SCI_disableInterrupt(SCIA_BASE, SCI_INT_TXFF);
    } else {
        SCI_enableInterrupt(SCIA_BASE, SCI_INT_TXFF);
    }
}

static __interrupt void on_received(void)
{
    fetch();
    SCI_clearInterruptStatus(SCIA_BASE, SCI_INT_RXFF);
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP9);
}

static __interrupt void on_sent(void)
{
    feed();
    Interrupt_clearACKGroup(INTERRUPT_ACK_GROUP9);
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

void f28_serial_init(void)
{
    f28_ring_init(&received, receive_octets, F28_RECEIVE_RING);
    f28_ring_init(&to_send, send_octets, F28_SEND_RING);
    overruns = 0UL;
    errors = 0UL;
    init_pins();
    SCI_performSoftwareReset(SCIA_BASE);
    SCI_setConfig(SCIA_BASE, F28_LSPCLK_HZ, F28_BAUD, SCI_CONFIG_WLEN_8); /* one stop bit, no parity: both are 0 */
    SCI_resetChannels(SCIA_BASE);
    SCI_resetRxFIFO(SCIA_BASE);
    SCI_resetTxFIFO(SCIA_BASE);
    SCI_enableFIFO(SCIA_BASE);
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

void f28_serial_service(void)
{
    uint16_t status;

    (void)Interrupt_disableGlobal();
    status = SCI_getRxStatus(SCIA_BASE);
    fetch();
    if ((status & (LINE_ERRORS | SCI_RXSTATUS_OVERRUN)) != 0U) {
        if ((status & LINE_ERRORS) != 0U) {
            errors++;
        }
        if ((status & SCI_RXSTATUS_OVERRUN) != 0U) {
            overruns = overruns + 1UL;
        }
        /* After a break the SCI receives nothing more until this reset, which also clears the flags. An octet that is
         * just being sent is damaged by it; the checksum of its frame tells the other end. */
        SCI_performSoftwareReset(SCIA_BASE);
    }
    (void)Interrupt_enableGlobal();
}

uint16_t f28_serial_take(fs_octet *out, uint16_t room)
{
    uint16_t n = 0U;

    while (n < room && f28_ring_take(&received, &out[n]) != 0U) {
        n++;
    }
    return n;
}

uint16_t f28_serial_room(void)
{
    return f28_ring_room(&to_send);
}

uint16_t f28_serial_give(const fs_octet *octets, uint16_t count)
{
    uint16_t n = 0U;

    while (n < count && f28_ring_put(&to_send, octets[n]) != 0U) {
        n++;
    }
    if (f28_ring_held(&to_send) != 0U) { /* also when nothing was given: an interrupt that was missed costs one pass */
        (void)Interrupt_disableGlobal();
        feed();
        (void)Interrupt_enableGlobal();
    }
    return n;
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
    return errors;
}
