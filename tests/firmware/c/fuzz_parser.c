/*
 * Coverage-guided fuzz of parser and codec: clang -fsanitize=fuzzer,address,undefined, or `make fuzz-firmware`.
 *
 * Besides what the sanitisers see it holds three promises: every octet is accounted for, a frame that was found
 * can be framed again and is found again as it was, and the parser's memory never fills.
 */
#include <stddef.h>
#include <stdlib.h>

#include "codec_shim.h"

#define HOLD(promise) \
    if (!(promise)) { \
        abort();      \
    }

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size);

static void found(const fs_frame *frame)
{
    static fs_octet payload[FS_MAX_PAYLOAD], once[FS_MAX_PAYLOAD], bytes[FS_MAX_FRAME];
    uint16_t i, again = 0U, length, size;
    fs_parser parser;
    fs_frame other;

    for (i = 0U; i < frame->length; i++) {
        HOLD(frame->payload[i] <= 0xFFU)
        payload[i] = (fs_octet)(frame->payload[i] | 0xA500U);
    }
    length = codec_recode(frame->id, payload, frame->length, once);
    HOLD(length >= 1U)
    size = fs_frame_encode(bytes, frame->id, frame->sequence, frame->system, frame->component, once, length);
    fs_parser_init(&parser);
    for (i = 0U; i < size; i++) {
        HOLD(again == 0U)
        again = fs_parser_push(&parser, (fs_octet)(bytes[i] | 0x5A00U), &other);
    }
    HOLD(again == 1U && other.id == frame->id && other.length == length && other.system == frame->system)
    HOLD(other.sequence == frame->sequence && other.component == frame->component && parser.count == 0U)
    for (i = 0U; i < length; i++) {
        HOLD(other.payload[i] == once[i])
        HOLD(once[i] == (i < frame->length ? frame->payload[i] : 0U))
    }
}

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size)
{
    fs_parser parser;
    fs_frame frame;
    size_t i;

    fs_parser_init(&parser);
    for (i = 0; i < size; i++) {
        uint16_t more = fs_parser_push(&parser, (fs_octet)(data[i] | (i << 8)), &frame);

        HOLD(parser.count < FS_MAX_HELD)
        while (more) {
            found(&frame);
            more = (data[i] & 1U) ? fs_parser_next(&parser, &frame) : 0U;
        }
    }
    HOLD(parser.good + parser.unknown > 0U || parser.skipped + parser.count == size)
    while (fs_parser_flush(&parser, &frame)) {
        found(&frame);
    }
    HOLD(parser.count == 0U)
    HOLD(parser.skipped + 8U * (parser.good + parser.unknown) <= size)
    return 0;
}
