/* Arm semihosting, as "Semihosting for AArch32 and AArch64" (Arm IHI 0101) defines it. */
#include "semihosting.h"

#define SYS_OPEN 0x01U
#define SYS_WRITE0 0x04U
#define SYS_WRITE 0x05U
#define SYS_READ 0x06U
#define SYS_GET_CMDLINE 0x15U
#define SYS_EXIT 0x18U
#define STOPPED_APPLICATION_EXIT 0x20026UL
#define STOPPED_RUN_TIME_ERROR 0x20023UL

static uint32_t call(uint32_t operation, uint32_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static uint32_t address_of(const volatile void *object)
{
    return (uint32_t)(uintptr_t)object;
}

int32_t semihosting_open(const char *name, uint32_t mode)
{
    uint32_t length = 0U;
    volatile uint32_t arguments[3];

    while (name[length] != '\0') {
        length++;
    }
    arguments[0] = address_of(name);
    arguments[1] = mode;
    arguments[2] = length;
    return (int32_t)call(SYS_OPEN, address_of(arguments));
}

uint32_t semihosting_read(int32_t handle, unsigned char *octets, uint32_t room)
{
    volatile uint32_t arguments[3];
    uint32_t missing;

    arguments[0] = (uint32_t)handle;
    arguments[1] = address_of(octets);
    arguments[2] = room;
    missing = call(SYS_READ, address_of(arguments));
    return (missing > room) ? 0U : room - missing;
}

uint16_t semihosting_write(int32_t handle, const unsigned char *octets, uint32_t length)
{
    volatile uint32_t arguments[3];

    arguments[0] = (uint32_t)handle;
    arguments[1] = address_of(octets);
    arguments[2] = length;
    return (call(SYS_WRITE, address_of(arguments)) == 0U) ? 1U : 0U;
}

void semihosting_write_text(const char *text)
{
    (void)call(SYS_WRITE0, address_of(text));
}

uint16_t semihosting_command_line(char *text, uint32_t room)
{
    volatile uint32_t arguments[2];

    arguments[0] = address_of(text);
    arguments[1] = room;
    return (call(SYS_GET_CMDLINE, address_of(arguments)) == 0U) ? 1U : 0U;
}

__attribute__((noreturn)) void semihosting_exit(uint16_t success)
{
    for (;;) {
        (void)call(SYS_EXIT, success ? STOPPED_APPLICATION_EXIT : STOPPED_RUN_TIME_ERROR);
    }
}
