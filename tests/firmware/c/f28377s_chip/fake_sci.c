/* SCIA of the simulated chip: its registers, FIFOs, shift register. Behaviour after SPRUHX5 and driverlib's sources. */
#include "fake_sci_line.h"

#include <string.h>

#define FIFO 16U
#define SCI_WORDS 16U
#define KEPT_FFTX (SCI_FFTX_SCIRST | SCI_FFTX_SCIFFENA | SCI_FFTX_TXFIFORESET | SCI_FFTX_TXFFIENA | SCI_FFTX_TXFFIL_M)
#define KEPT_FFRX (SCI_FFRX_RXFIFORESET | SCI_FFRX_RXFFIENA | SCI_FFRX_RXFFIL_M)

typedef struct {
    uint16_t octets[FIFO], held;
} fifo;

static uint16_t cells[SCI_WORDS], shown[SCI_WORDS];
static void written(uint32_t offset);
fake_area fake_sci_area = {SCIA_BASE, SCI_WORDS, cells, shown, written, 0U};

static struct {
    uint16_t flags_are;
    uint16_t fftx, ffrx, ctl1; /* as written last */
    fifo rx, tx;
    uint16_t rx_flag, tx_flag, rx_met, tx_met;
    uint16_t status, overflow, deaf, stop_at_errors;
    uint16_t shifting, shift_busy, damaged;
    uint64_t shift_done;
} sci;

static uint16_t has(uint16_t word, uint32_t bit)
{
    return (word & bit) != 0U;
}

/* Follow the FIFO levels: set flags whose condition holds, and raise interrupts of flags that rose. */
static void follow_flags(void)
{
    const uint16_t rx_meets = sci.rx.held >= (sci.ffrx & SCI_FFRX_RXFFIL_M);
    const uint16_t tx_meets = sci.tx.held <= (sci.fftx & SCI_FFTX_TXFFIL_M);

    if (rx_meets && !sci.rx_flag && (sci.flags_are == FAKE_LEVEL || !sci.rx_met)) {
        sci.rx_flag = 1U;
        if (has(sci.ffrx, SCI_FFRX_RXFFIENA)) {
            fake_raise(FAKE_RECEIVED);
        }
    }
    if (tx_meets && !sci.tx_flag && (sci.flags_are == FAKE_LEVEL || !sci.tx_met)) {
        sci.tx_flag = 1U;
        if (has(sci.fftx, SCI_FFTX_TXFFIENA)) {
            fake_raise(FAKE_SENT);
        }
    }
    sci.rx_met = rx_meets;
    sci.tx_met = tx_meets;
}

static uint16_t take_oldest(fifo *from)
{
    const uint16_t oldest = from->octets[0];

    memmove(&from->octets[0], &from->octets[1], (FIFO - 1U) * sizeof from->octets[0]);
    from->held--;
    return oldest;
}

static uint16_t is_on(void)
{
    return has(sci.ctl1, SCI_CTL1_SWRESET) && has(sci.fftx, SCI_FFTX_SCIFFENA) && has(sci.fftx, SCI_FFTX_SCIRST);
}

static uint16_t receives(void)
{
    return is_on() && has(sci.ctl1, SCI_CTL1_RXENA) && has(sci.ffrx, SCI_FFRX_RXFIFORESET) && !sci.deaf;
}

void fake_sci_receive(uint16_t what)
{
    if (!receives()) {
        return;
    }
    if ((what & FAKE_BREAK) != 0U) {
        sci.status |= SCI_RXSTATUS_BREAK | SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_ERROR;
        sci.deaf = 1U;
        return;
    }
    if ((what & FAKE_OVERRUN) != 0U) {
        sci.status |= SCI_RXSTATUS_OVERRUN | SCI_RXSTATUS_ERROR;
        return;
    }
    if ((what & FAKE_FRAMING) != 0U) {
        sci.status |= SCI_RXSTATUS_FRAMING | SCI_RXSTATUS_ERROR;
    }
    if (sci.rx.held == FIFO) { /* the oldest one is lost */
        sci.overflow = 1U;
        (void)take_oldest(&sci.rx);
    }
    sci.rx.octets[sci.rx.held++] = (what & 0xFFU) | ((what & FAKE_FRAMING) != 0U ? SCI_RXBUF_SCIFFFE : 0U);
    if ((what & FAKE_FRAMING) != 0U && sci.stop_at_errors) {
        sci.deaf = 1U;
        fake_line_in_step();
    }
}

uint64_t fake_sci_next(uint64_t most)
{
    const uint64_t line = fake_line_next(most);
    const uint64_t left = sci.shift_done - fake_time();

    return (sci.shift_busy && left < line) ? left : line;
}

void fake_sci_pass(void)
{
    fake_line_pass();
    if (sci.shift_busy && fake_time() >= sci.shift_done) {
        fake_line_send(sci.damaged ? (uint16_t)(sci.shifting ^ 0x55U) : sci.shifting);
        sci.shift_busy = 0U;
    }
    if (!sci.shift_busy && sci.tx.held > 0U && is_on() && has(sci.ctl1, SCI_CTL1_TXENA)) {
        sci.shifting = take_oldest(&sci.tx);
        sci.shift_busy = 1U;
        sci.damaged = 0U;
        sci.shift_done = fake_time() + fake_octet_cycles();
    }
    follow_flags();
}

void fake_sci_show(uint32_t offset)
{
    if (offset == SCI_O_RXBUF) {
        if (sci.rx.held == 0U) {
            fake_note("read from an empty FIFO");
        } else {
            fake_show(&fake_sci_area, SCI_O_RXBUF, take_oldest(&sci.rx));
            follow_flags();
        }
    }
    fake_show(&fake_sci_area, SCI_O_RXST, sci.status);
    fake_show(&fake_sci_area, SCI_O_TXBUF, FAKE_UNWRITTEN);
    fake_show(&fake_sci_area, SCI_O_FFTX,
              (uint16_t)(sci.fftx | sci.tx.held << SCI_FFTX_TXFFST_S | (sci.tx_flag ? SCI_FFTX_TXFFINT : 0U)));
    fake_show(&fake_sci_area, SCI_O_FFRX,
              (uint16_t)(sci.ffrx | sci.rx.held << SCI_FFRX_RXFFST_S | (sci.rx_flag ? SCI_FFRX_RXFFINT : 0U) |
                         (sci.overflow ? SCI_FFRX_RXFFOVF : 0U)));
}

void fake_sci_strike(void)
{
    if (has(sci.ffrx, SCI_FFRX_RXFFIENA)) {
        fake_raise(FAKE_RECEIVED);
    }
    if (has(sci.fftx, SCI_FFTX_TXFFIENA)) {
        fake_raise(FAKE_SENT);
    }
}

static void software_reset(void)
{
    fake_line_cut();
    sci.status = 0U;
    sci.deaf = 0U;
    sci.damaged = sci.shift_busy;
}

static void write_ctl1(uint16_t value)
{
    const uint16_t before = sci.ctl1;

    sci.ctl1 = value;
    if (has(before, SCI_CTL1_SWRESET) && !has(value, SCI_CTL1_SWRESET)) {
        software_reset();
    }
}

static void write_txbuf(uint16_t value)
{
    if (sci.tx.held == FIFO || !is_on()) {
        fake_note("wrote into a full FIFO, or one that is off");
        return;
    }
    if (value > 0xFFU) {
        fake_note("sent an octet with high bits");
    }
    sci.tx.octets[sci.tx.held++] = value;
    fake_sci_pass();
}

static void write_fftx(uint16_t value)
{
    const uint16_t was_on = has(sci.fftx, SCI_FFTX_TXFFIENA);

    sci.fftx = value & KEPT_FFTX;
    if (has(value, SCI_FFTX_TXFFINTCLR)) {
        sci.tx_flag = 0U;
    }
    if (!has(value, SCI_FFTX_TXFIFORESET) || !has(value, SCI_FFTX_SCIRST)) {
        sci.tx.held = 0U;
    }
    if (!has(value, SCI_FFTX_SCIRST)) {
        sci.rx.held = 0U;
    }
    if (!was_on && has(value, SCI_FFTX_TXFFIENA) && sci.tx_flag && sci.flags_are == FAKE_LEVEL) {
        fake_raise(FAKE_SENT);
    }
    follow_flags();
}

static void write_ffrx(uint16_t value)
{
    const uint16_t was_on = has(sci.ffrx, SCI_FFRX_RXFFIENA);

    sci.ffrx = value & KEPT_FFRX;
    if (has(value, SCI_FFRX_RXFFINTCLR)) {
        sci.rx_flag = 0U;
    }
    if (has(value, SCI_FFRX_RXFFOVRCLR)) {
        sci.overflow = 0U;
    }
    if (!has(value, SCI_FFRX_RXFIFORESET)) {
        sci.rx.held = 0U;
    }
    if (!was_on && has(value, SCI_FFRX_RXFFIENA) && sci.rx_flag && sci.flags_are == FAKE_LEVEL) {
        fake_raise(FAKE_RECEIVED);
    }
    follow_flags();
}

static void written(uint32_t offset)
{
    const uint16_t value = cells[offset];

    switch (offset) {
    case SCI_O_CCR:
        if (value != SCI_CONFIG_WLEN_8) {
            fake_note("not 8N1");
        }
        break;
    case SCI_O_CTL1:
        write_ctl1(value);
        break;
    case SCI_O_TXBUF:
        write_txbuf(value);
        break;
    case SCI_O_FFTX:
        write_fftx(value);
        break;
    case SCI_O_FFRX:
        write_ffrx(value);
        break;
    default:
        break;
    }
    fake_sci_show(SCI_O_FFTX);
}

uint64_t fake_octet_cycles(void)
{
    const uint64_t divider = ((uint64_t)cells[SCI_O_HBAUD] << 8U | cells[SCI_O_LBAUD]) + 1U;

    fake_settle();
    return 10U * 8U * divider * fake_lspclk_divider();
}

void fake_stop_at_errors(void)
{
    sci.stop_at_errors = 1U;
}

void fake_sci_power_on(uint16_t flags_are)
{
    memset(&sci, 0, sizeof sci);
    sci.flags_are = flags_are;
    sci.fftx = SCI_FFTX_SCIRST | SCI_FFTX_TXFIFORESET;
    sci.ffrx = SCI_FFRX_RXFIFORESET | SCI_FFRX_RXFFIL_M;
    fake_line_power_on();
    fake_sci_show(SCI_O_FFTX);
}
