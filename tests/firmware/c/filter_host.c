/* The estimator on the host: `filter_host INPUT OUTPUT` writes the hash after every event, and at the end of all. */
#include <stdio.h>

#include "filter_steps.h"

static void put_u32(FILE *output, uint32_t value)
{
    uint16_t shift;

    for (shift = 0U; shift < 32U; shift = (uint16_t)(shift + 8U)) {
        fputc((int)((value >> shift) & 0xFFU), output);
    }
}

int main(int argc, char **argv)
{
    static filter_steps all;
    FILE *const input = (argc == 3) ? fopen(argv[1], "rb") : NULL;
    FILE *const output = (argc == 3) ? fopen(argv[2], "wb") : NULL;
    int octet;

    if (input == NULL || output == NULL) {
        fprintf(stderr, "usage: filter_host INPUT OUTPUT\n");
        return 2;
    }
    filter_steps_init(&all, 0);
    while ((octet = fgetc(input)) != EOF) {
        if (filter_steps_push(&all, (uint16_t)octet) != 0U) {
            put_u32(output, all.hash);
        }
    }
    put_u32(output, filter_steps_hash(&all));
    fclose(input);
    return (fclose(output) == 0) ? 0 : 2;
}
