/*
 * The part of TI's driverlib (f2837xs) that the port uses, for a host: names, types and values as in C2000Ware, so that
 * the port compiles against either. What the functions do stands in fake_driverlib.c.
 */
#ifndef FAKE_DRIVERLIB_H
#define FAKE_DRIVERLIB_H

#include <stdbool.h>
#include <stdint.h>

#define __interrupt
#define EALLOW fake_eallow()
#define EDIS fake_edis()
void fake_eallow(void);
void fake_edis(void);

/* sci.h */
#define SCIA_BASE 0x00007200U
#define SCI_O_RXBUF 0x7U
#define SCI_RXBUF_SCIFFPE 0x4000U
#define SCI_RXBUF_SCIFFFE 0x8000U
#define HWREGH(address) fake_register(address) /* to be read only */
uint16_t fake_register(uint32_t address);
#define SCI_INT_TXFF 0x08U
#define SCI_INT_RXFF 0x10U
#define SCI_CONFIG_WLEN_8 0x0007U
#define SCI_CONFIG_STOP_ONE 0x0000U
#define SCI_RXSTATUS_PARITY 0x0004U
#define SCI_RXSTATUS_OVERRUN 0x0008U
#define SCI_RXSTATUS_FRAMING 0x0010U
#define SCI_RXSTATUS_BREAK 0x0020U
#define SCI_RXSTATUS_ERROR 0x0080U
typedef enum { SCI_CONFIG_PAR_NONE = 0, SCI_CONFIG_PAR_EVEN = 0x60, SCI_CONFIG_PAR_ODD = 0x20 } SCI_ParityType;
typedef enum { SCI_FIFO_TX0 = 0, SCI_FIFO_TX4 = 4, SCI_FIFO_TX16 = 16 } SCI_TxFIFOLevel;
typedef enum { SCI_FIFO_RX0 = 0, SCI_FIFO_RX8 = 8, SCI_FIFO_RX16 = 16 } SCI_RxFIFOLevel;
void SCI_setConfig(uint32_t base, uint32_t lspclkHz, uint32_t baud, uint32_t config);
void SCI_setFIFOInterruptLevel(uint32_t base, SCI_TxFIFOLevel txLevel, SCI_RxFIFOLevel rxLevel);
void SCI_enableFIFO(uint32_t base);
void SCI_enableModule(uint32_t base);
void SCI_resetChannels(uint32_t base);
void SCI_resetRxFIFO(uint32_t base);
void SCI_resetTxFIFO(uint32_t base);
void SCI_performSoftwareReset(uint32_t base);
void SCI_enableInterrupt(uint32_t base, uint32_t intFlags);
void SCI_disableInterrupt(uint32_t base, uint32_t intFlags);
void SCI_clearInterruptStatus(uint32_t base, uint32_t intFlags);
SCI_RxFIFOLevel SCI_getRxFIFOStatus(uint32_t base);
SCI_TxFIFOLevel SCI_getTxFIFOStatus(uint32_t base);
uint16_t SCI_getRxStatus(uint32_t base);
void SCI_writeCharNonBlocking(uint32_t base, uint16_t data);
bool SCI_getOverflowStatus(uint32_t base);
void SCI_clearOverflowStatus(uint32_t base);

/* cputimer.h */
#define CPUTIMER0_BASE 0x00000C00U
#define CPUTIMER1_BASE 0x00000C08U
void CPUTimer_setPeriod(uint32_t base, uint32_t periodCount);
void CPUTimer_setPreScaler(uint32_t base, uint16_t prescaler);
void CPUTimer_stopTimer(uint32_t base);
void CPUTimer_startTimer(uint32_t base);
void CPUTimer_reloadTimerCounter(uint32_t base);
void CPUTimer_clearOverflowFlag(uint32_t base);
void CPUTimer_enableInterrupt(uint32_t base);
uint32_t CPUTimer_getTimerCount(uint32_t base);

/* interrupt.h */
#define INT_TIMER0 0x00260107U
#define INT_SCIA_RX 0x00600901U
#define INT_SCIA_TX 0x00610902U
#define INTERRUPT_ACK_GROUP1 0x1U
#define INTERRUPT_ACK_GROUP9 0x100U
void Interrupt_initModule(void);
void Interrupt_initVectorTable(void);
void Interrupt_register(uint32_t interruptNumber, void (*handler)(void));
void Interrupt_enable(uint32_t interruptNumber);
void Interrupt_clearACKGroup(uint16_t group);
bool Interrupt_enableGlobal(void);
bool Interrupt_disableGlobal(void);

/* sysctl.h */
#define SYSCTL_CAUSE_POR 0x00000001U
#define SYSCTL_CAUSE_XRS 0x00000002U
#define SYSCTL_CAUSE_WDRS 0x00000004U
#define SYSCTL_CAUSE_NMIWDRS 0x00000008U
typedef enum { SYSCTL_LSPCLK_PRESCALE_1 = 0, SYSCTL_LSPCLK_PRESCALE_4 = 2 } SysCtl_LSPCLKPrescaler;
typedef enum { SYSCTL_WD_PRESCALE_1 = 1, SYSCTL_WD_PRESCALE_8 = 4, SYSCTL_WD_PRESCALE_64 = 7 } SysCtl_WDPrescaler;
void SysCtl_setLowSpeedClock(SysCtl_LSPCLKPrescaler prescaler);
uint32_t SysCtl_getResetCause(void);
void SysCtl_clearResetCause(uint32_t rstCauses);
void SysCtl_setWatchdogPrescaler(SysCtl_WDPrescaler prescaler);
void SysCtl_serviceWatchdog(void);
void SysCtl_enableWatchdog(void);

/* gpio.h, pin_map.h */
#define GPIO_12_GPIO12 0x00061800U
#define GPIO_13_GPIO13 0x00061A00U
#define GPIO_84_SCITXDA 0x00880805U
#define GPIO_85_SCIRXDA 0x00880A05U
#define GPIO_PIN_TYPE_STD 0x0000U
#define GPIO_PIN_TYPE_PULLUP 0x0001U
typedef enum { GPIO_DIR_MODE_IN, GPIO_DIR_MODE_OUT } GPIO_Direction;
typedef enum { GPIO_QUAL_SYNC, GPIO_QUAL_3SAMPLE, GPIO_QUAL_6SAMPLE, GPIO_QUAL_ASYNC } GPIO_QualificationMode;
void GPIO_setPinConfig(uint32_t pinConfig);
void GPIO_setPadConfig(uint32_t pin, uint32_t pinType);
void GPIO_setDirectionMode(uint32_t pin, GPIO_Direction pinIO);
void GPIO_setQualificationMode(uint32_t pin, GPIO_QualificationMode qualification);
void GPIO_writePin(uint32_t pin, uint32_t outVal);

#endif
