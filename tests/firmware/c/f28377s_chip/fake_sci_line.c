#include "fake_sci_line.h"

#include <string.h>

#define LINE 65536U

static struct {
    uint16_t astray; /* bit of the octet before in which the receiver found a false start; 0: it is in step */
    uint16_t before; /* that octet, as the line brought it */
    uint16_t cut, cut_at; /* 1: a software reset hit the octet that is on the line, in this bit */
    uint64_t next;
    uint16_t octets[LINE], sent[LINE];
    uint32_t first, end, sent_end, sent_taken;
} line;

/* Return a bit of what the line brings: 0 the start bit, 1 to 8 the data, 9 the stop bit. */
static uint16_t line_bit(uint16_t what, uint32_t bit)
{
    if ((what & FAKE_PAUSE) != 0U) {
        return 1U;
    }
    if (bit == 0U) {
        return 0U;
    }
    if (bit == 9U) {
        return (what & FAKE_FRAMING) == 0U;
    }
    return (uint16_t)(what >> (bit - 1U)) & 1U;
}

/* The receiver looks for a start bit from this bit on; what it finds inside an octet leads it astray. */
static void look_for_start(uint16_t what, uint32_t bit)
{
    while (bit < 10U && line_bit(what, bit) != 0U) {
        bit++;
    }
    line.astray = (bit < 10U) ? (uint16_t)bit : 0U;
    line.before = what;
}

/* Return what a receiver that is astray makes of the octet before and this one, and let it look for the next start. */
static uint16_t false_octet(uint16_t what)
{
    const uint32_t start = line.astray;
    uint32_t i, at, octet = 0U;

    for (i = 0U; i < 8U; i++) {
        at = start + 1U + i;
        octet |= (uint32_t)(at < 10U ? line_bit(line.before, at) : line_bit(what, at - 10U)) << i;
    }
    if (line_bit(what, start - 1U) == 0U) {
        octet |= FAKE_FRAMING;
    }
    look_for_start(what, start);
    return (uint16_t)octet;
}

static void bring(uint16_t what)
{
    if (line.cut) {
        line.cut = 0U;
        look_for_start(what, line.cut_at);
        return;
    }
    if ((what & FAKE_BREAK) != 0U) {
        line.astray = 0U;
    } else if (line.astray != 0U) {
        what = false_octet(what);
    } else {
        /* in step */
    }
    if ((what & FAKE_PAUSE) == 0U) {
        fake_sci_receive(what);
    }
}

uint64_t fake_line_next(uint64_t most)
{
    const uint64_t left = line.next - fake_time();

    return (line.first != line.end && left < most) ? left : most;
}

void fake_line_pass(void)
{
    if (line.first != line.end && fake_time() >= line.next) {
        bring(line.octets[line.first++ % LINE]);
        line.next += fake_octet_cycles();
    }
}

/* Nothing is lost while the line has brought but a start bit. */
void fake_line_cut(void)
{
    const uint64_t began = line.next - fake_octet_cycles();
    const uint16_t what = line.octets[line.first % LINE];

    line.astray = 0U;
    if (line.first == line.end || fake_time() < began || (what & (FAKE_PAUSE | FAKE_BREAK)) != 0U) {
        return;
    }
    line.cut_at = (uint16_t)((fake_time() - began) * 10U / fake_octet_cycles());
    line.cut = line.cut_at > 0U;
}

void fake_line_in_step(void)
{
    line.astray = 0U;
}

void fake_line(const uint16_t *octets, uint32_t count)
{
    uint32_t i;

    if (line.first == line.end) {
        line.next = fake_time() + fake_octet_cycles();
    }
    for (i = 0U; i < count; i++) {
        line.octets[line.end++ % LINE] = octets[i];
    }
}

uint32_t fake_line_waits(void)
{
    return line.end - line.first;
}

void fake_line_send(uint16_t octet)
{
    line.sent[line.sent_end++ % LINE] = octet;
}

uint32_t fake_sent(uint16_t *octets, uint32_t room)
{
    uint32_t n = 0U;

    while (n < room && line.sent_taken != line.sent_end) {
        octets[n++] = line.sent[line.sent_taken++ % LINE];
    }
    return n;
}

void fake_line_power_on(void)
{
    memset(&line, 0, sizeof line);
}
