/* Runs an ELF file on simavr's ATmega1284P: octets of one file go in, results go to another.
 *
 * Usage: avr_simulator ELF INPUT OUTPUT. Exit code 0 when the program went to sleep, as it does at its end.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

/* data addresses of GPIOR0, 1, 2 of the ATmega1284P */
#define GPIOR0_AT 0x3E
#define GPIOR1_AT 0x4A
#define GPIOR2_AT 0x4B

typedef struct {
    FILE *input, *output;
    int next;
} link;

static uint8_t take(struct avr_t *avr, avr_io_addr_t address, void *param)
{
    link *const own = param;
    const int octet = own->next;

    (void)avr;
    (void)address;
    own->next = fgetc(own->input);
    return (uint8_t)octet;
}

static uint8_t tell(struct avr_t *avr, avr_io_addr_t address, void *param)
{
    (void)avr;
    (void)address;
    return ((const link *)param)->next != EOF;
}

static void give(struct avr_t *avr, avr_io_addr_t address, uint8_t octet, void *param)
{
    (void)avr;
    (void)address;
    fputc(octet, ((link *)param)->output);
}

static int simulate(const char *path, link *own)
{
    elf_firmware_t firmware = {0};
    avr_t *const avr = avr_make_mcu_by_name("atmega1284p");
    int state = cpu_Running;

    if (avr == NULL || avr_init(avr) != 0 || elf_read_firmware(path, &firmware) != 0) {
        fprintf(stderr, "avr_simulator: cannot load %s\n", path);
        return 2;
    }
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    avr_register_io_read(avr, GPIOR0_AT, take, own);
    avr_register_io_read(avr, GPIOR1_AT, tell, own);
    avr_register_io_write(avr, GPIOR2_AT, give, own);
    while (state != cpu_Done && state != cpu_Crashed) {
        state = avr_run(avr);
    }
    fprintf(stderr, "%llu cycles\n", (unsigned long long)avr->cycle);
    return (state == cpu_Done) ? 0 : 1;
}

int main(int argc, char **argv)
{
    link own;
    int result;

    if (argc != 4) {
        fprintf(stderr, "usage: avr_simulator ELF INPUT OUTPUT\n");
        return 2;
    }
    own.input = fopen(argv[2], "rb");
    own.output = fopen(argv[3], "wb");
    if (own.input == NULL || own.output == NULL) {
        fprintf(stderr, "avr_simulator: cannot open %s or %s\n", argv[2], argv[3]);
        return 2;
    }
    own.next = fgetc(own.input);
    result = simulate(argv[1], &own);
    fclose(own.input);
    return (fclose(own.output) == 0) ? result : 2;
}
