/* What the tests of the codec do with it in C, because a call from Python for each octet is slow. */
#ifndef CODEC_SHIM_H
#define CODEC_SHIM_H

#include "fs_messages.h"
#include "fs_parser.h"

/* A found frame as the tests want it: its message decoded and encoded again beside it. */
typedef struct {
    fs_frame frame;
    uint16_t recoded_length;
    fs_octet recoded[FS_MAX_PAYLOAD];
} codec_found;

typedef struct {
    uint32_t found;   /* frames, also those that did not fit */
    uint32_t flushed; /* how many of them only fs_parser_flush gave */
    uint32_t good, bad, unknown, skipped, held;
} codec_summary;

/* Decode a payload into its structure and encode that again; returns the length, 0 for an unknown message. */
uint16_t codec_recode(uint32_t id, const fs_octet *payload, uint16_t length, fs_octet *out);

/*
 * Parse octets; what is behind a frame is asked for at once when eager is set, else it comes with later octets.
 * The high bits of what the codec is given are rubbish that changes when poisoned is set. flush ends the stream.
 */
void codec_parse(const unsigned char *octets, uint32_t count, uint16_t eager, uint16_t poisoned, uint16_t flush,
                 codec_found *out, uint32_t room, codec_summary *summary);

#endif
