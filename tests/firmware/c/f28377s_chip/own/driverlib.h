/*
 * The part of TI's driverlib (f2837xs) that the port uses, for tests without C2000Ware: names, types and values as in
 * C2000Ware, so that the port compiles against either. Each function does to the registers what driverlib's does.
 */
#ifndef OWN_DRIVERLIB_H
#define OWN_DRIVERLIB_H

#include <stdbool.h>
#include <stdint.h>

#include "registers.h"

#define __interrupt
volatile uint16_t *fake_at16(uint32_t address);
volatile uint32_t *fake_at32(uint32_t address);
uint16_t __disable_interrupts(void);
uint16_t __enable_interrupts(void);
void __eallow(void);
void __edis(void);
extern volatile uint16_t IER, IFR;
#define HWREGH(address) (*fake_at16(address))
#define HWREG(address) (*fake_at32(address))
#define EALLOW __eallow()
#define EDIS __edis()

/* sci.h, sci.c */
typedef enum { SCI_FIFO_TX0 = 0, SCI_FIFO_TX4 = 4, SCI_FIFO_TX16 = 16 } SCI_TxFIFOLevel;
typedef enum { SCI_FIFO_RX0 = 0, SCI_FIFO_RX8 = 8, SCI_FIFO_RX16 = 16 } SCI_RxFIFOLevel;

static inline void fake_set16(uint32_t address, uint32_t bits)
{
    HWREGH(address) |= (uint16_t)bits;
}

static inline void fake_clear16(uint32_t address, uint32_t bits)
{
    HWREGH(address) &= (uint16_t)~bits;
}

static inline void fake_replace16(uint32_t address, uint32_t field, uint32_t value)
{
    HWREGH(address) = (uint16_t)((HWREGH(address) & ~field) | value);
}

static inline void fake_strobe(uint32_t address, uint32_t bit)
{
    fake_clear16(address, bit);
    fake_set16(address, bit);
}

static inline void SCI_enableModule(uint32_t base)
{
    fake_set16(base + SCI_O_CTL1, SCI_CTL1_TXENA | SCI_CTL1_RXENA | SCI_CTL1_SWRESET);
}

/* driverlib switches the FIFOs off here, and not on again */
static inline void SCI_setConfig(uint32_t base, uint32_t lspclkHz, uint32_t baud, uint32_t config)
{
    const uint32_t divider = lspclkHz / (baud * 8U) - 1U;

    fake_clear16(base + SCI_O_FFTX, SCI_FFTX_SCIFFENA);
    fake_clear16(base + SCI_O_CTL1, SCI_CTL1_TXENA | SCI_CTL1_RXENA);
    HWREGH(base + SCI_O_HBAUD) = (uint16_t)(divider >> 8U & 0xFFU);
    HWREGH(base + SCI_O_LBAUD) = (uint16_t)(divider & 0xFFU);
    fake_replace16(base + SCI_O_CCR, 0xE7U, config); /* parity, stop bits, length */
    SCI_enableModule(base);
}

static inline void SCI_setFIFOInterruptLevel(uint32_t base, SCI_TxFIFOLevel txLevel, SCI_RxFIFOLevel rxLevel)
{
    fake_replace16(base + SCI_O_FFTX, SCI_FFTX_TXFFIL_M, (uint32_t)txLevel);
    fake_replace16(base + SCI_O_FFRX, SCI_FFRX_RXFFIL_M, (uint32_t)rxLevel);
}

static inline void SCI_enableFIFO(uint32_t base)
{
    fake_set16(base + SCI_O_FFTX, SCI_FFTX_SCIRST);
    fake_set16(base + SCI_O_FFTX, SCI_FFTX_SCIFFENA | SCI_FFTX_TXFIFORESET);
    fake_set16(base + SCI_O_FFRX, SCI_FFRX_RXFIFORESET);
}

static inline void SCI_resetChannels(uint32_t base)
{
    fake_strobe(base + SCI_O_FFTX, SCI_FFTX_SCIRST);
}

static inline void SCI_resetRxFIFO(uint32_t base)
{
    fake_strobe(base + SCI_O_FFRX, SCI_FFRX_RXFIFORESET);
}

static inline void SCI_resetTxFIFO(uint32_t base)
{
    fake_strobe(base + SCI_O_FFTX, SCI_FFTX_TXFIFORESET);
}

static inline void SCI_performSoftwareReset(uint32_t base)
{
    fake_strobe(base + SCI_O_CTL1, SCI_CTL1_SWRESET);
}

static inline void SCI_enableInterrupt(uint32_t base, uint32_t intFlags)
{
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        fake_set16(base + SCI_O_FFTX, SCI_FFTX_TXFFIENA);
    }
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        fake_set16(base + SCI_O_FFRX, SCI_FFRX_RXFFIENA);
    }
}

static inline void SCI_disableInterrupt(uint32_t base, uint32_t intFlags)
{
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        fake_clear16(base + SCI_O_FFTX, SCI_FFTX_TXFFIENA);
    }
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        fake_clear16(base + SCI_O_FFRX, SCI_FFRX_RXFFIENA);
    }
}

static inline void SCI_clearInterruptStatus(uint32_t base, uint32_t intFlags)
{
    if ((intFlags & ~(uint32_t)(SCI_INT_RXFF | SCI_INT_TXFF)) != 0U) {
        SCI_performSoftwareReset(base); /* so does driverlib */
    }
    if ((intFlags & SCI_INT_TXFF) != 0U) {
        fake_set16(base + SCI_O_FFTX, SCI_FFTX_TXFFINTCLR);
    }
    if ((intFlags & SCI_INT_RXFF) != 0U) {
        fake_set16(base + SCI_O_FFRX, SCI_FFRX_RXFFINTCLR);
    }
}

static inline SCI_RxFIFOLevel SCI_getRxFIFOStatus(uint32_t base)
{
    return (SCI_RxFIFOLevel)((HWREGH(base + SCI_O_FFRX) & SCI_FFRX_RXFFST_M) >> SCI_FFRX_RXFFST_S);
}

static inline SCI_TxFIFOLevel SCI_getTxFIFOStatus(uint32_t base)
{
    return (SCI_TxFIFOLevel)((HWREGH(base + SCI_O_FFTX) & SCI_FFTX_TXFFST_M) >> SCI_FFTX_TXFFST_S);
}

static inline uint16_t SCI_getRxStatus(uint32_t base)
{
    return HWREGH(base + SCI_O_RXST);
}

static inline void SCI_writeCharNonBlocking(uint32_t base, uint16_t data)
{
    HWREGH(base + SCI_O_TXBUF) = data;
}

static inline bool SCI_getOverflowStatus(uint32_t base)
{
    return (HWREGH(base + SCI_O_FFRX) & SCI_FFRX_RXFFOVF) != 0U;
}

static inline void SCI_clearOverflowStatus(uint32_t base)
{
    fake_set16(base + SCI_O_FFRX, SCI_FFRX_RXFFOVRCLR);
}

/* cputimer.h: writing the flag TIF clears it */

static inline void fake_timer_bits(uint32_t base, uint32_t bits)
{
    fake_replace16(base + CPUTIMER_O_TCR, CPUTIMER_TCR_TIF, bits);
}

static inline void CPUTimer_setPeriod(uint32_t base, uint32_t periodCount)
{
    HWREG(base + CPUTIMER_O_PRD) = periodCount;
}

static inline void CPUTimer_setPreScaler(uint32_t base, uint16_t prescaler)
{
    HWREGH(base + CPUTIMER_O_TPRH) = prescaler >> 8U;
    HWREGH(base + CPUTIMER_O_TPR) = prescaler & 0xFFU;
}

static inline void CPUTimer_stopTimer(uint32_t base)
{
    fake_timer_bits(base, CPUTIMER_TCR_TSS);
}

static inline void CPUTimer_reloadTimerCounter(uint32_t base)
{
    fake_timer_bits(base, CPUTIMER_TCR_TRB);
}

static inline void CPUTimer_startTimer(uint32_t base)
{
    CPUTimer_reloadTimerCounter(base);
    fake_clear16(base + CPUTIMER_O_TCR, CPUTIMER_TCR_TSS);
}

static inline void CPUTimer_clearOverflowFlag(uint32_t base)
{
    fake_set16(base + CPUTIMER_O_TCR, CPUTIMER_TCR_TIF);
}

static inline void CPUTimer_enableInterrupt(uint32_t base)
{
    fake_timer_bits(base, CPUTIMER_TCR_TIE);
}

static inline uint32_t CPUTimer_getTimerCount(uint32_t base)
{
    return HWREG(base + CPUTIMER_O_TIM);
}

/* interrupt.h, interrupt.c: the upper half of a number is its place in the table of vectors */

static inline bool Interrupt_enableGlobal(void)
{
    return (__enable_interrupts() & 1U) != 0U;
}

static inline bool Interrupt_disableGlobal(void)
{
    return (__disable_interrupts() & 1U) != 0U;
}

static inline void Interrupt_initModule(void)
{
    uint32_t i;

    (void)Interrupt_disableGlobal();
    IER = 0U;
    IFR = 0U;
    for (i = PIE_O_IER1; i <= PIE_O_IFR12; i++) {
        HWREGH(PIECTRL_BASE + i) = 0U;
    }
    fake_set16(PIECTRL_BASE + PIE_O_CTRL, PIE_CTRL_ENPIE);
}

static inline void Interrupt_register(uint32_t interruptNumber, void (*handler)(void))
{
    EALLOW;
    HWREG(PIEVECTTABLE_BASE + (interruptNumber >> 16U) * 2U) = (uint32_t)(uintptr_t)handler;
    EDIS;
}

void Interrupt_initVectorTable(void);

static inline void Interrupt_enable(uint32_t interruptNumber)
{
    const uint32_t group = (interruptNumber >> 8U & 0xFFU) - 1U;
    const bool was_off = Interrupt_disableGlobal();

    fake_set16(PIECTRL_BASE + PIE_O_IER1 + group * 2U, 1U << ((interruptNumber & 0xFFU) - 1U));
    IER |= (uint16_t)(1U << group);
    if (!was_off) {
        (void)Interrupt_enableGlobal();
    }
}

static inline void Interrupt_clearACKGroup(uint16_t group)
{
    HWREGH(PIECTRL_BASE + PIE_O_ACK) = group;
}

/* sysctl.h */
typedef enum { SYSCTL_LSPCLK_PRESCALE_1 = 0, SYSCTL_LSPCLK_PRESCALE_4 = 2 } SysCtl_LSPCLKPrescaler;
typedef enum { SYSCTL_WD_PRESCALE_1 = 1, SYSCTL_WD_PRESCALE_8 = 4, SYSCTL_WD_PRESCALE_64 = 7 } SysCtl_WDPrescaler;

static inline void SysCtl_setLowSpeedClock(SysCtl_LSPCLKPrescaler prescaler)
{
    EALLOW;
    HWREG(CLKCFG_BASE + SYSCTL_O_LOSPCP) =
        (HWREG(CLKCFG_BASE + SYSCTL_O_LOSPCP) & ~SYSCTL_LOSPCP_LSPCLKDIV_M) | (uint32_t)prescaler;
    EDIS;
}

static inline uint32_t SysCtl_getResetCause(void)
{
    return HWREG(CPUSYS_BASE + SYSCTL_O_RESC) & 0x10FU;
}

static inline void SysCtl_clearResetCause(uint32_t rstCauses)
{
    HWREG(CPUSYS_BASE + SYSCTL_O_RESC) = rstCauses;
}

static inline void SysCtl_setWatchdogPrescaler(SysCtl_WDPrescaler prescaler)
{
    EALLOW;
    fake_replace16(WD_BASE + SYSCTL_O_WDCR, SYSCTL_WDCR_WDPS_M, (uint32_t)prescaler | SYSCTL_WD_CHKBITS);
    EDIS;
}

static inline void SysCtl_serviceWatchdog(void)
{
    EALLOW;
    HWREGH(WD_BASE + SYSCTL_O_WDKEY) = SYSCTL_WD_ENRSTKEY;
    HWREGH(WD_BASE + SYSCTL_O_WDKEY) = SYSCTL_WD_RSTKEY;
    EDIS;
}

static inline void SysCtl_enableWatchdog(void)
{
    EALLOW;
    fake_replace16(WD_BASE + SYSCTL_O_WDCR, SYSCTL_WDCR_WDDIS, SYSCTL_WD_CHKBITS);
    EDIS;
}

/* gpio.h, gpio.c: two bits for each pin in a MUX, one in the others; a port has 64 words */
typedef enum { GPIO_DIR_MODE_IN, GPIO_DIR_MODE_OUT } GPIO_Direction;
typedef enum { GPIO_QUAL_SYNC, GPIO_QUAL_3SAMPLE, GPIO_QUAL_6SAMPLE, GPIO_QUAL_ASYNC } GPIO_QualificationMode;

static inline void fake_replace32(uint32_t address, uint32_t field, uint32_t value)
{
    HWREG(address) = (HWREG(address) & ~field) | value;
}

static inline void fake_pin_bit(uint32_t pin, uint32_t offset, uint32_t value)
{
    EALLOW;
    fake_replace32(GPIOCTRL_BASE + pin / 32U * GPIO_O_GPBCTRL + offset, 1U << pin % 32U, value << pin % 32U);
    EDIS;
}

static inline void GPIO_setPinConfig(uint32_t pinConfig)
{
    const uint32_t address = GPIOCTRL_BASE + (pinConfig >> 16U), shift = pinConfig >> 8U & 0xFFU;

    EALLOW;
    fake_replace32(address, 3U << shift, 0U); /* no other peripheral in between */
    fake_replace32(address + GPIO_O_GPAGMUX1 - GPIO_O_GPAMUX1, 3U << shift, (pinConfig >> 2U & 3U) << shift);
    fake_replace32(address, 3U << shift, (pinConfig & 3U) << shift);
    EDIS;
}

static inline void GPIO_setPadConfig(uint32_t pin, uint32_t pinType)
{
    fake_pin_bit(pin, GPIO_O_GPAPUD, (pinType & GPIO_PIN_TYPE_PULLUP) == 0U);
}

static inline void GPIO_setDirectionMode(uint32_t pin, GPIO_Direction pinIO)
{
    fake_pin_bit(pin, GPIO_O_GPADIR, (uint32_t)pinIO);
}

static inline void GPIO_setQualificationMode(uint32_t pin, GPIO_QualificationMode qualification)
{
    const uint32_t shift = pin % 16U * 2U, port = GPIOCTRL_BASE + pin / 32U * GPIO_O_GPBCTRL;

    EALLOW;
    fake_replace32(port + 2U + pin % 32U / 16U * 2U, 3U << shift, (uint32_t)qualification << shift);
    EDIS;
}

static inline void GPIO_writePin(uint32_t pin, uint32_t outVal)
{
    HWREG(GPIODATA_BASE + pin / 32U * GPIO_O_GPBDAT + ((outVal == 0U) ? GPIO_O_GPACLEAR : GPIO_O_GPASET)) =
        1U << pin % 32U;
}

#endif
