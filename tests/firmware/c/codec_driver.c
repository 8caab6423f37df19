/* Parse what comes on standard input, with every way of the codec, for runs under sanitisers and gcov. */
#include <stdio.h>
#include <stdlib.h>

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

int main(void)
{
    static unsigned char octets[8UL << 20];
    uint32_t count = (uint32_t)fread(octets, 1, sizeof octets, stdin), found;
    uint16_t way;
    int failed = 0;

    for (way = 0U; way < 8U; way++) {
        failed |= run(octets, count, way, &found);
    }
    return failed;
}
