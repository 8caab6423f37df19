/* Files of the host, through Arm semihosting. */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stdint.h>

#define SEMIHOSTING_READ_BINARY 1U  /* fopen's "rb" */
#define SEMIHOSTING_WRITE_BINARY 5U /* fopen's "wb" */

int32_t semihosting_open(const char *name, uint32_t mode);                       /* handle, or -1 */
uint32_t semihosting_read(int32_t handle, unsigned char *octets, uint32_t room); /* octets read; 0 at the end */
uint16_t semihosting_write(int32_t handle, const unsigned char *octets, uint32_t length); /* 1 if all went out */
void semihosting_write_text(const char *text);                                   /* to the host's console */
uint16_t semihosting_command_line(char *text, uint32_t room);                    /* 1 if it fits, with its NUL */
__attribute__((noreturn)) void semihosting_exit(uint16_t success);

#endif
