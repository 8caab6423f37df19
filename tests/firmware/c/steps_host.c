/* The steps on the host: `steps_host INPUT OUTPUT` writes what steps_avr.c writes. */
#include <stdio.h>

#include "steps.h"

static void put_u32(FILE *output, uint32_t value)
{
    uint16_t shift;

    for (shift = 0U; shift < 32U; shift = (uint16_t)(shift + 8U)) {
        fputc((int)((value >> shift) & 0xFFU), output);
    }
}

int main(int argc, char **argv)
{
    static steps all;
    FILE *const input = (argc == 3) ? fopen(argv[1], "rb") : NULL;
    FILE *const output = (argc == 3) ? fopen(argv[2], "wb") : NULL;
    int octet;

    if (input == NULL || output == NULL) {
        fprintf(stderr, "usage: steps_host INPUT OUTPUT\n");
        return 2;
    }
    steps_init(&all, 0);
    while ((octet = fgetc(input)) != EOF) {
        /* rubbish in the high bits, which the codec has to mask */
        if (steps_push(&all, (fs_octet)((unsigned)octet | 0x5A00U)) != 0U) {
            put_u32(output, all.hash);
        }
    }
    put_u32(output, all.refused);
    fclose(input);
    return (fclose(output) == 0) ? 0 : 2;
}
