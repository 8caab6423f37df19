/* The few registers of the MPS2 board (AN386) that this port needs.
 *
 * Sources: Arm Application Note AN386 (memory map, interrupts), the Cortex-M System Design Kit's technical
 * reference manual (UART and timer), the ARMv7-M architecture reference manual (SysTick, NVIC, FPU, semihosting).
 */
#ifndef MPS2_BOARD_H
#define MPS2_BOARD_H

#include <stdint.h>

#define MPS2_CLOCK_HZ 25000000UL
#define MPS2_BAUD 115200UL

#define MPS2_REGISTER(address) (*(volatile uint32_t *)(address))

#define MPS2_TIMER0_CONTROL MPS2_REGISTER(0x40000000UL)
#define MPS2_TIMER0_VALUE MPS2_REGISTER(0x40000004UL)
#define MPS2_TIMER0_RELOAD MPS2_REGISTER(0x40000008UL)
#define MPS2_TIMER_ENABLE 1UL

#define MPS2_UART0_DATA MPS2_REGISTER(0x40004000UL)
#define MPS2_UART0_STATE MPS2_REGISTER(0x40004004UL)
#define MPS2_UART0_CONTROL MPS2_REGISTER(0x40004008UL)
#define MPS2_UART0_INTERRUPT MPS2_REGISTER(0x4000400CUL)
#define MPS2_UART0_DIVIDER MPS2_REGISTER(0x40004010UL)
#define MPS2_UART_STATE_SENDING 1UL
#define MPS2_UART_STATE_RECEIVED 2UL
#define MPS2_UART_STATE_OVERRUN 8UL
#define MPS2_UART_SEND 1UL
#define MPS2_UART_RECEIVE 2UL
#define MPS2_UART_SEND_INTERRUPT 4UL
#define MPS2_UART_RECEIVE_INTERRUPT 8UL
#define MPS2_UART0_RECEIVE_IRQ 0U
#define MPS2_UART0_SEND_IRQ 1U

#define MPS2_SYSTICK_CONTROL MPS2_REGISTER(0xE000E010UL)
#define MPS2_SYSTICK_RELOAD MPS2_REGISTER(0xE000E014UL)
#define MPS2_SYSTICK_VALUE MPS2_REGISTER(0xE000E018UL)
#define MPS2_SYSTICK_RUN 7UL /* processor clock, interrupt, enable */

#define MPS2_NVIC_ENABLE MPS2_REGISTER(0xE000E100UL)
#define MPS2_FPU_ACCESS MPS2_REGISTER(0xE000ED88UL)

/* mps2_uart.c: octets through interrupts and two rings */
void mps2_uart_init(void);
int mps2_uart_take(void);             /* next octet received, or -1 */
uint16_t mps2_uart_room(void);        /* octets that mps2_uart_give can take now */
void mps2_uart_give(uint16_t octet);  /* queue an octet; only while there is room */
uint16_t mps2_uart_can_set_baud(uint32_t baud);
uint16_t mps2_uart_set_baud(uint32_t baud); /* 0, without effect, while octets are being sent */
uint32_t mps2_uart_overruns(void);    /* octets lost: by the hardware or because the ring was full */
void mps2_uart_receive_interrupt(void);
void mps2_uart_send_interrupt(void);

/* mps2_time.c */
void mps2_time_init(void);        /* the timer */
void mps2_tick_init(void);        /* SysTick's interrupt, every millisecond */
uint32_t mps2_now_ms(void);       /* by SysTick's interrupt */
uint32_t mps2_instructions(void); /* under QEMU's -icount shift=10 only */
uint32_t mps2_microseconds(void); /* of the emulated clock, modulo 2^32 */
uint32_t mps2_nanoseconds(void);  /* of the emulated clock, modulo 2^32 */
void mps2_tick_interrupt(void);

/* mps2_start.c */
uint32_t mps2_stack_size(void);       /* octets */
uint32_t mps2_stack_high_water(void); /* octets of it that were ever used */

int main(void);

#endif
