/*
 * The same codec on any machine: make frames of random fields, damage the line, parse, recode, and hash all that
 * comes of it. Host, Cortex-M4 and AVR have to print the same number. Static memory and 16-bit ints are enough.
 *
 * Prints 8 hexadecimal digits and a newline through codec_print, which the machine supplies.
 */
#include "codec_shim.h"

#ifndef CODEC_ROUNDS
#define CODEC_ROUNDS 400U
#endif

void codec_print(char character);

typedef struct {
    uint32_t random, hash;
    fs_parser parser;
    fs_frame frame;
    fs_octet octets[FS_MAX_FRAME], payload[FS_MAX_PAYLOAD];
} self_hash;

static const uint32_t IDS[15] = {0, 4, 20, 21, 22, 23, 345, 76, 77, 148, 253, 53010UL, 53011UL, 53012UL, 53013UL};

static uint16_t draw(self_hash *s) /* xorshift32, its upper half */
{
    s->random ^= s->random << 13;
    s->random ^= s->random >> 17;
    s->random ^= s->random << 5;
    return (uint16_t)(s->random >> 16);
}

static void add(self_hash *s, uint32_t value) /* FNV-1a, a number at a time */
{
    s->hash = (s->hash ^ (value & 0xFFFFFFFFUL)) * 16777619UL;
}

static void take(self_hash *s)
{
    uint16_t i, length = codec_recode(s->frame.id, s->frame.payload, s->frame.length, s->payload);

    add(s, s->frame.id);
    add(s, s->frame.sequence);
    add(s, s->frame.system);
    add(s, s->frame.component);
    for (i = 0U; i < s->frame.length; i++) {
        add(s, s->frame.payload[i]);
    }
    for (i = 0U; i < length; i++) {
        add(s, s->payload[i]);
    }
}

static void round_of(self_hash *s)
{
    uint32_t id = IDS[draw(s) % 15U];
    uint16_t i, size, length, cut = draw(s), sequence = draw(s), system = draw(s), component = draw(s);

    for (i = 0U; i < FS_MAX_PAYLOAD; i++) {
        s->payload[i] = draw(s); /* with rubbish in the high bits */
    }
    length = codec_recode(id, s->payload, cut % 256U, s->octets);
    for (i = 0U; i < length; i++) {
        s->payload[i] = s->octets[i];
    }
    size = fs_frame_encode(s->octets, id, sequence, system, component, s->payload, length);
    for (i = 0U; i < size; i++) {
        fs_octet octet = s->octets[i];

        add(s, octet);
        if (draw(s) < 200U) { /* one octet of 328 is changed on its way */
            octet = (fs_octet)(octet ^ draw(s));
        }
        if (draw(s) >= 100U) { /* and one of 655 is lost */
            uint16_t more = fs_parser_push(&s->parser, octet, &s->frame);

            while (more) {
                take(s);
                more = fs_parser_next(&s->parser, &s->frame);
            }
        }
    }
}

void codec_self_hash(void)
{
    static self_hash s;
    uint16_t i;

    s.random = 2463534242UL;
    s.hash = 2166136261UL;
    fs_parser_init(&s.parser);
    for (i = 0U; i < CODEC_ROUNDS; i++) {
        round_of(&s);
    }
    while (fs_parser_flush(&s.parser, &s.frame)) {
        take(&s);
    }
    add(&s, s.parser.good);
    add(&s, s.parser.bad);
    add(&s, s.parser.unknown);
    add(&s, s.parser.skipped);
    for (i = 0U; i < 8U; i++) {
        codec_print("0123456789abcdef"[(s.hash >> (28U - 4U * i)) & 15U]);
    }
    codec_print('\n');
}

#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

void codec_print(char character)
{
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = (uint8_t)character;
}

int main(void)
{
    UCSR0B = _BV(TXEN0);
    codec_self_hash();
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    cli();
    sleep_mode(); /* asleep without interrupts: the simulator ends */
    return 0;
}
#elif defined(__ARM_ARCH_7EM__)
/* The least that runs on QEMU's mps2-an386: vectors at 0, printing and the end by semihosting. */
static uint32_t semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void codec_print(char character)
{
    (void)semihosting(3U, &character); /* SYS_WRITEC */
}

static void reset(void)
{
    *(volatile uint32_t *)0xE000ED88UL |= 0xFUL << 20; /* let the FPU be used */
    codec_self_hash();
    (void)semihosting(0x18U, (const void *)0x20026UL); /* SYS_EXIT, all is well */
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))0x20010000UL, reset, reset, reset}; /* stack, start; a fault would start, and print, again */
#else
#include <stdio.h>

void codec_print(char character)
{
    putchar(character);
}

int main(void)
{
    codec_self_hash();
    return 0;
}
#endif
