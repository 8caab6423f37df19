#ifndef FS_PARSER_H
#define FS_PARSER_H

#include "fs_frame.h"

#define FS_MAX_HELD (FS_MAX_FRAME + 1U) /* a frame, and the octet behind it */

/*
 * Finds frames in a stream of octets, whatever comes: with the memory of one frame and bounded work.
 *
 * It holds octets that may begin a frame until it can be checked. A beginning that turns out to be none
 * costs one octet: the search goes on right behind it, inside what it seemed to enclose. So a damaged frame
 * never takes a good one with it. Frames of MAVLink 1 and 2 are accepted; of a signed one the signature is
 * skipped, not verified.
 *
 * Of a message that we do not know the checksum cannot be verified. In MAVLink 2 such a frame is passed over as
 * a whole when another one begins right behind it, or silence follows: frames that its payload may carry are not
 * meant for us. Otherwise it was no frame, and the search goes on inside: a header that lost an octet reads as an
 * unknown message, and would take the beginning of the next frame with it. In MAVLink 1, where one octet of 256
 * begins a frame, an unknown message, or a longer one than defined, is noise.
 */
typedef struct {
    fs_octet held[FS_MAX_HELD]; /* begins with a possible beginning of a frame, if nothing more was found */
    uint16_t count;             /* octets held, less than FS_MAX_HELD between calls */
    uint16_t needed;            /* octets to hold before the frame can be checked */
    uint32_t good;              /* frames returned */
    uint32_t bad;               /* would-be frames that were none, or were given up by fs_parser_flush */
    uint32_t unknown;           /* frames passed over because their message is unknown */
    uint32_t skipped;           /* octets that belonged to no frame */
} fs_parser;

/* Forget everything, the counters too. Counters count modulo 2^32. */
void fs_parser_init(fs_parser *parser);

/*
 * Take one octet. Return 1 when *frame holds a whole valid frame of a known message, which is written only then.
 * A frame can turn up inside what was thought part of another one, and more behind it: after a 1 ask
 * fs_parser_next until it returns 0. Without this call they are returned with the next octets.
 * At worst one call computes a checksum from each octet held to the last one.
 */
uint16_t fs_parser_push(fs_parser *parser, fs_octet octet, fs_frame *frame);

/* Search a further frame among the octets held; returns as fs_parser_push does. */
uint16_t fs_parser_next(fs_parser *parser, fs_frame *frame);

/*
 * For a line that has been silent for longer than octets of one frame lie apart: give up the beginning that is
 * held and search a frame inside it. Call it until it returns 0: then nothing is held any more.
 * Without it a wrong length could hold back the last frame before a silence until more octets come.
 */
uint16_t fs_parser_flush(fs_parser *parser, fs_frame *frame);

#endif
