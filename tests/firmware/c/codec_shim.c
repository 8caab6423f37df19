#include "codec_shim.h"

#define RECODE(BIG, small)                           \
    case FS_##BIG##_ID: {                            \
        fs_##small m;                                \
        fs_##small##_decode(payload, length, &m);    \
        return fs_##small##_encode(&m, out);         \
    }

uint16_t codec_recode(uint32_t id, const fs_octet *payload, uint16_t length, fs_octet *out)
{
    switch (id) {
        RECODE(HEARTBEAT, heartbeat)
        RECODE(PING, ping)
        RECODE(PARAM_REQUEST_READ, param_request_read)
        RECODE(PARAM_REQUEST_LIST, param_request_list)
        RECODE(PARAM_VALUE, param_value)
        RECODE(PARAM_SET, param_set_message)
        RECODE(PARAM_ERROR, param_error)
        RECODE(COMMAND_LONG, command_long)
        RECODE(COMMAND_ACK, command_ack)
        RECODE(AUTOPILOT_VERSION, autopilot_version)
        RECODE(STATUSTEXT, statustext)
        RECODE(PIL_STEP, pil_step)
        RECODE(PIL_REPORT, pil_report)
        RECODE(PIL_STATUS, pil_status)
        RECODE(PIL_IDENTITY, pil_identity)
        RECODE(PIL_TICK, pil_tick)
        RECODE(PIL_OUTPUT, pil_output)
        RECODE(PIL_STATE, pil_state)
        RECODE(PIL_DRIVE, pil_drive)
        RECODE(PIL_TIMING, pil_timing)
        RECODE(PIL_SENSE, pil_sense)
        RECODE(PIL_ESTIMATE, pil_estimate)
        RECODE(PIL_MEMORY, pil_memory)
    default:
        return 0U;
    }
}

/* Rubbish for the high bits, different for every octet. */
static fs_octet rubbish(uint32_t number, uint16_t poisoned)
{
    return (fs_octet)(poisoned ? ((number * 0x9E3779B1UL) >> 8) & 0xFF00UL : 0UL);
}

static void keep(const fs_frame *frame, uint16_t poisoned, codec_found *out, uint32_t room, codec_summary *summary)
{
    uint16_t i;

    if (summary->found < room) {
        codec_found *found = &out[summary->found];
        fs_octet payload[FS_MAX_PAYLOAD];

        for (i = 0U; i < frame->length; i++) {
            payload[i] = (fs_octet)(frame->payload[i] | rubbish(i + 1UL, poisoned));
        }
        found->frame.id = frame->id;
        found->frame.system = frame->system;
        found->frame.component = frame->component;
        found->frame.sequence = frame->sequence;
        found->frame.length = frame->length;
        for (i = 0U; i < frame->length; i++) {
            found->frame.payload[i] = frame->payload[i];
        }
        found->recoded_length = codec_recode(frame->id, payload, frame->length, found->recoded);
    }
    summary->found++;
}

void codec_parse(const unsigned char *octets, uint32_t count, uint16_t eager, uint16_t poisoned, uint16_t flush,
                 codec_found *out, uint32_t room, codec_summary *summary)
{
    fs_parser parser;
    fs_frame frame;
    uint32_t i;

    fs_parser_init(&parser);
    summary->found = 0U;
    summary->flushed = 0U;
    for (i = 0U; i < count; i++) {
        uint16_t more = fs_parser_push(&parser, (fs_octet)(octets[i] | rubbish(i, poisoned)), &frame);

        while (more) {
            keep(&frame, poisoned, out, room, summary);
            more = eager ? fs_parser_next(&parser, &frame) : 0U;
        }
    }
    while (flush && fs_parser_flush(&parser, &frame)) {
        summary->flushed++;
        keep(&frame, poisoned, out, room, summary);
    }
    summary->good = parser.good;
    summary->bad = parser.bad;
    summary->unknown = parser.unknown;
    summary->skipped = parser.skipped;
    summary->held = parser.count;
}
