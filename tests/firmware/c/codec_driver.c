/* Parse what comes on standard input, with every way of the codec, for runs under sanitisers and gcov. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "codec_shim.h"

static int run(const unsigned char *octets, uint32_t count, uint16_t way, uint32_t *found)
{
    codec_summary summary;
    codec_found *out = malloc(sizeof(codec_found) * (count / 8U + 1U));
    uint32_t i, wrong = 0U;

    if (out == NULL) {
        return 1;
    }
    codec_parse(octets, count, way & 1U, way & 2U, way & 4U, out, count / 8U + 1U, &summary);
    for (i = 0U; i < summary.found; i++) {
        fs_octet bytes[FS_MAX_FRAME];
        uint16_t size = fs_frame_encode(bytes, out[i].frame.id, out[i].frame.sequence, out[i].frame.system,
                                        out[i].frame.component, out[i].recoded, out[i].recoded_length);

        wrong += size != FS_HEADER_V2 + out[i].recoded_length + FS_CHECKSUM_SIZE;
    }
    *found = summary.found;
    printf("%u %u %u %u %u\n", (unsigned)summary.good, (unsigned)summary.bad, (unsigned)summary.unknown,
           (unsigned)summary.skipped, (unsigned)summary.held);
    free(out);
    return wrong != 0U;
}

/* What no stream brings about: refused frames, text. Returns whether anything was not as it should be. */
static int edges(void)
{
    static const char text[] = "ATT_REF_BW";
    fs_octet out[FS_MAX_FRAME] = {0}, field[16];
    fs_octet beyond[2] = {0x80U, 0x41U};
    char back[17];
    int wrong = 0;

    wrong |= fs_frame_encode(out, 30UL, 0U, 1U, 1U, out, 1U) != 0U;
    wrong |= fs_frame_encode(out, FS_PING_ID, 0U, 1U, 1U, out, 256U) != 0U;
    fs_text_put(field, 16U, text);
    fs_text_get(field, 16U, back);
    wrong |= strcmp(text, back) != 0;
    fs_text_put(field, 3U, text);
    fs_text_get(field, 3U, back);
    wrong |= strcmp("ATT", back) != 0;
    fs_text_get(beyond, 2U, back);
    wrong |= strcmp("?A", back) != 0;
    return wrong;
}

int main(void)
{
    static unsigned char octets[8UL << 20];
    uint32_t count = (uint32_t)fread(octets, 1, sizeof octets, stdin), found;
    uint16_t way;
    int failed = edges();

    for (way = 0U; way < 8U; way++) {
        failed |= run(octets, count, way, &found);
    }
    return failed;
}
