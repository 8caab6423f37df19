#include "fs_parser.h"

#include "fs_messages.h"

typedef enum {
    FS_WAIT,    /* more octets are needed to tell */
    FS_NOISE,   /* no frame begins here */
    FS_BAD,     /* a frame seemed to begin here, but its checksum or what follows it is wrong */
    FS_UNKNOWN, /* a frame of a message that we do not know */
    FS_GOOD
} fs_verdict;

/* What the octets from a possible beginning on say about the frame. */
typedef struct {
    fs_verdict verdict;
    uint16_t size;   /* of the frame; with FS_WAIT the octets needed to know more */
    uint16_t header; /* octets before the payload */
    uint32_t id;
    uint16_t crc_extra;
} fs_candidate;

static fs_verdict fs_check(const fs_octet *at, const fs_candidate *candidate)
{
    uint16_t end = (uint16_t)(candidate->header + at[1]);
    uint16_t crc = fs_crc_add_all(FS_CRC_START, &at[1], (uint16_t)(end - 1U));

    crc = fs_crc_add(crc, candidate->crc_extra);
    return (crc == fs_get_u16(&at[end], FS_CHECKSUM_SIZE, 0U)) ? FS_GOOD : FS_BAD;
}

static void fs_judge_v1(const fs_octet *at, uint16_t count, fs_candidate *candidate)
{
    fs_message_kind kind;

    candidate->header = FS_HEADER_V1;
    candidate->size = FS_HEADER_V1;
    if (count < FS_HEADER_V1) {
        return;
    }
    candidate->id = at[5];
    candidate->size = (uint16_t)(FS_HEADER_V1 + at[1] + FS_CHECKSUM_SIZE);
    if ((fs_message_kind_of(candidate->id, &kind) == 0U) || (at[1] > kind.length)) {
        candidate->verdict = FS_NOISE;
    } else if (count >= candidate->size) {
        candidate->crc_extra = kind.crc_extra;
        candidate->verdict = fs_check(at, candidate);
    } else {
        /* the rest of it has not come */
    }
}

/* Check a whole frame of unknown checksum by the octets that follow it. */
static void fs_judge_unknown(const fs_octet *at, uint16_t count, uint16_t silent, fs_candidate *candidate)
{
    if (count > candidate->size) {
        fs_octet next = at[candidate->size];

        candidate->verdict = ((next == FS_MAGIC_V1) || (next == FS_MAGIC_V2)) ? FS_UNKNOWN : FS_BAD;
    } else if (silent != 0U) {
        candidate->verdict = FS_UNKNOWN;
    } else {
        candidate->size++;
    }
}

static void fs_judge_v2(const fs_octet *at, uint16_t count, uint16_t silent, fs_candidate *candidate)
{
    fs_message_kind kind;

    candidate->header = FS_HEADER_V2;
    candidate->size = 3U; /* as far as the flags */
    if (count < 3U) {
        return;
    }
    if (at[2] > FS_FLAG_SIGNED) {
        candidate->verdict = FS_NOISE; /* a flag that we would have to understand and do not */
        return;
    }
    candidate->size = (uint16_t)(FS_HEADER_V2 + at[1] + FS_CHECKSUM_SIZE);
    if (at[2] == FS_FLAG_SIGNED) {
        candidate->size = (uint16_t)(candidate->size + FS_SIGNATURE_SIZE);
    }
    if (count < candidate->size) {
        return;
    }
    candidate->id = fs_get_u32(&at[7], 3U, 0U); /* of 24 bits */
    if (fs_message_kind_of(candidate->id, &kind) == 0U) {
        fs_judge_unknown(at, count, silent, candidate);
    } else {
        candidate->crc_extra = kind.crc_extra;
        candidate->verdict = fs_check(at, candidate);
    }
}

/* Check the count octets, one at least, from a place on where a frame may begin; silent: no more will come. */
static void fs_judge(const fs_octet *at, uint16_t count, uint16_t silent, fs_candidate *candidate)
{
    candidate->verdict = FS_WAIT;
    if (at[0] == FS_MAGIC_V1) {
        fs_judge_v1(at, count, candidate);
    } else if (at[0] == FS_MAGIC_V2) {
        fs_judge_v2(at, count, silent, candidate);
    } else {
        candidate->verdict = FS_NOISE;
    }
}

static void fs_take(const fs_octet *at, const fs_candidate *candidate, fs_frame *frame)
{
    uint16_t ids = (uint16_t)(candidate->header == FS_HEADER_V1 ? 2U : 4U); /* where sequence and sender stand */

    frame->id = candidate->id;
    frame->length = at[1];
    frame->sequence = at[ids];
    frame->system = at[ids + 1U];
    frame->component = at[ids + 2U];
    fs_put_octets(frame->payload, &at[candidate->header], at[1]);
}

/* Drop the first octets held. */
static void fs_drop(fs_parser *parser, uint16_t octets)
{
    uint16_t i;

    parser->count = (uint16_t)(parser->count - octets);
    for (i = 0U; i < parser->count; i++) {
        parser->held[i] = parser->held[i + octets];
    }
}

/*
 * Find the first frame among the octets held, and drop everything before it and itself. Without one, keep only the
 * beginning that has to wait for its rest; when the line is silent nothing waits.
 */
static uint16_t fs_scan(fs_parser *parser, uint16_t silent, fs_frame *frame)
{
    uint16_t at = 0U, found = 0U, waiting = 0U;
    fs_candidate candidate;

    parser->needed = 1U;
    while ((at < parser->count) && (found == 0U) && (waiting == 0U)) {
        fs_judge(&parser->held[at], (uint16_t)(parser->count - at), silent, &candidate);
        if ((candidate.verdict == FS_WAIT) && (silent == 0U)) {
            waiting = 1U;
            parser->needed = candidate.size;
        } else if (candidate.verdict == FS_GOOD) {
            found = 1U;
            parser->good++;
            fs_take(&parser->held[at], &candidate, frame);
            at = (uint16_t)(at + candidate.size);
        } else if (candidate.verdict == FS_UNKNOWN) {
            parser->unknown++;
            at = (uint16_t)(at + candidate.size);
        } else {
            if (candidate.verdict != FS_NOISE) {
                parser->bad++;
            }
            parser->skipped++;
            at++;
        }
    }
    fs_drop(parser, at);
    return found;
}

void fs_parser_init(fs_parser *parser)
{
    parser->count = 0U;
    parser->needed = 1U;
    parser->good = 0U;
    parser->bad = 0U;
    parser->unknown = 0U;
    parser->skipped = 0U;
}

uint16_t fs_parser_push(fs_parser *parser, fs_octet octet, fs_frame *frame)
{
    /* There is room: fewer octets wait than are waited for, and a frame that is found leaves more of it. */
    parser->held[parser->count] = (fs_octet)(octet & 0xFFU);
    parser->count++;
    return (parser->count < parser->needed) ? 0U : fs_scan(parser, 0U, frame);
}

uint16_t fs_parser_next(fs_parser *parser, fs_frame *frame)
{
    return fs_scan(parser, 0U, frame);
}

uint16_t fs_parser_flush(fs_parser *parser, fs_frame *frame)
{
    return fs_scan(parser, 1U, frame);
}
