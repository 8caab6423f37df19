#ifndef FS_PARSER_H
#define FS_PARSER_H

#include "fs_frame.h"

/*
 * Finds frames in a stream of octets, whatever comes: with less than one frame of memory and bounded work.
 *
 * It holds what may be the beginning of a frame until it can be judged. A beginning that turns out to be none
 * costs one octet: the search goes on right behind it, inside what it seemed to enclose. So a damaged frame
 * never takes a good one with it. Frames of MAVLink 1 and 2 are accepted; of a signed one the signature is
 * skipped, not verified.
 *
 * A frame of MAVLink 2 with an unknown message is passed over as a whole: without its definition the checksum
 * cannot be verified, and frames that some payload carries are not meant for us. In MAVLink 1 one octet of 256
 * begins a frame, so there an unknown message, or a longer one than defined, is noise.
 */
typedef struct {
    fs_octet held[FS_MAX_FRAME]; /* begins with a possible beginning of a frame, after every call */
    uint16_t count;              /* octets held, less than FS_MAX_FRAME between calls */
    uint16_t needed;             /* so many have to be held before there is anything to judge */
    uint32_t good;               /* frames returned */
    uint32_t bad;                /* would-be frames with a wrong checksum, or given up by fs_parser_flush */
    uint32_t unknown;            /* frames passed over because their message is unknown */
    uint32_t skipped;            /* octets that belonged to no frame */
} fs_parser;

/* Forget everything, the counters too. Counters count modulo 2^32. */
void fs_parser_init(fs_parser *parser);

/*
 * Take one octet. Return 1 when *frame holds a whole valid frame of a known message, which is written only then.
 * A frame can turn up inside what was thought part of another one, and more behind it: after a 1 ask
 * fs_parser_next until it returns 0. Who does not ask gets them with the next octets.
 * At worst one call computes the checksum of FS_MAX_FRAME octets FS_MAX_FRAME times.
 */
uint16_t fs_parser_push(fs_parser *parser, fs_octet octet, fs_frame *frame);

/* Look for a further frame among the octets held; returns as fs_parser_push does. */
uint16_t fs_parser_next(fs_parser *parser, fs_frame *frame);

/*
 * For a line that has been silent for longer than octets of one frame lie apart: give up the beginning that is
 * held and look for a frame inside it. Call it until it returns 0: then nothing is held any more.
 * Without it a wrong length could hold back the last frame before a silence until more octets come.
 */
uint16_t fs_parser_flush(fs_parser *parser, fs_frame *frame);

#endif
