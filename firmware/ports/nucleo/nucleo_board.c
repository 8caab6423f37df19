/*
 * STM32 Nucleo-64 with STM32F401RE or STM32F446RE: USART2 on PA2 and PA3, which the ST-LINK passes to USB as a serial
 * port; the light LD2 on PA5. Sources beside nucleo_registers.h: UM1724 (the board), the data sheets' electrical limits.
 *
 * The receiver holds one octet, so its interrupt puts each into a ring. The main loop sends.
 */
#include "fs_app.h"
#include "fs_board.h"
#include "fs_ring.h"
#include "fs_start.h"
#include "nucleo_registers.h"

#ifndef NUCLEO_BAUD
#define NUCLEO_BAUD 115200UL
#endif

/*
 * The PLL makes 336 MHz of 1 MHz, and 84 MHz (F401) or 168 MHz (F446) of that; APB1 runs at 42 MHz on both. Flash waits
 * for 2 or 5 cycles at 2.7 to 3.6 V. Above 168 MHz an F446 would need its over-drive.
 */
#if defined(NUCLEO_F401RE)
#define CLOCK_HZ 84000000UL
#define PLL_DIVIDER_BITS (1UL << 16) /* by 4 */
#define BUS_DIVIDERS RCC_CFGR_PPRE1_2
#define FLASH_WAITS 2UL
#define VOLTAGE_SCALE (2UL << 14)
#elif defined(NUCLEO_F446RE)
#define CLOCK_HZ 168000000UL
#define PLL_DIVIDER_BITS 0UL /* by 2 */
#define BUS_DIVIDERS (RCC_CFGR_PPRE1_4 | RCC_CFGR_PPRE2_2)
#define FLASH_WAITS 5UL
#define VOLTAGE_SCALE (3UL << 14)
#else
#error "define NUCLEO_F401RE or NUCLEO_F446RE"
#endif
#define PLL_BITS(input_mhz) ((2UL << 28) | (7UL << 24) | PLL_DIVIDER_BITS | (336UL << 6) | (input_mhz))
#define BUS_HZ 42000000UL
#define HSI_HZ 16000000UL

#define DIVIDER(bus_hz) (((bus_hz) + NUCLEO_BAUD / 2UL) / NUCLEO_BAUD)
#if NUCLEO_BAUD < 1200UL
#error "NUCLEO_BAUD: below 1200 baud the pause between two octets passes for the end of a frame (FS_APP_SILENCE_MS)"
#elif BUS_HZ / NUCLEO_BAUD < 16UL
#error "NUCLEO_BAUD: 2625000 baud at most"
#elif BUS_HZ > DIVIDER(BUS_HZ) * NUCLEO_BAUD / 100UL * 102UL || BUS_HZ < DIVIDER(BUS_HZ) * NUCLEO_BAUD / 100UL * 98UL
#error "NUCLEO_BAUD: USART2 misses this rate by more than 2 %; it makes 115200, 921600, 1000000, 2000000"
#endif

#define PATIENCE 20000UL /* readings of a flag, 12 ms; HSE and PLL are ready within 2 ms */
#define RING 1024U        /* octets, a power of two */
#define LIGHT (1UL << 5)
#define OUT_2_AND_3_ALTERNATE ((2UL << 4) | (2UL << 6))

static volatile fs_octet received_octets[RING];
static fs_ring received;
static volatile uint32_t overruns, errors, milliseconds;
static uint32_t clock_hz, serviced_ms;

void nucleo_millisecond(void)
{
    milliseconds = milliseconds + 1U;
}

void nucleo_received(void)
{
    const uint32_t status = USART2_SR; /* reading the data after it clears its errors */
    const fs_octet octet = (fs_octet)(USART2_DR & 0xFFU);

    if ((status & USART_SR_DAMAGED) != 0U) {
        errors = errors + 1U;
    }
    if ((status & USART_SR_ORE) != 0U) {
        overruns = overruns + 1U;
    }
    if ((status & USART_SR_RXNE) != 0U && fs_ring_put(&received, octet) == 0U) {
        overruns = overruns + 1U;
    }
}

/* Wait for bits of a register; 0 if they do not come. */
static uint16_t is_reached(volatile const uint32_t *at, uint32_t mask, uint32_t bits)
{
    uint32_t n;

    for (n = 0U; n < PATIENCE; n++) {
        if ((*at & mask) == bits) {
            return 1U;
        }
    }
    return 0U;
}

/* Switch to the PLL, from the ST-LINK's 8 MHz or else from the internal 16 MHz; without a PLL stay at 16 MHz. */
static void start_clock(void)
{
    uint32_t pll = PLL_BITS(16UL);

    clock_hz = HSI_HZ;
    RCC_APB1ENR |= RCC_APB1ENR_PWR;
    PWR_CR = (PWR_CR & ~PWR_CR_VOS) | VOLTAGE_SCALE;
    RCC_CR |= RCC_CR_HSEBYP;
    RCC_CR |= RCC_CR_HSEON;
    if (is_reached(&RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY) != 0U) {
        pll = PLL_BITS(8UL) | RCC_PLLCFGR_HSE;
    }
    RCC_PLLCFGR = pll;
    RCC_CR |= RCC_CR_PLLON;
    if (is_reached(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY) == 0U) {
        return;
    }
    FLASH_ACR = FLASH_ACR_CACHES | FLASH_WAITS;
    if (is_reached(&FLASH_ACR, FLASH_ACR_LATENCY, FLASH_WAITS) == 0U) {
        return;
    }
    RCC_CFGR = BUS_DIVIDERS | RCC_CFGR_SW_PLL;
    if (is_reached(&RCC_CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL) != 0U) {
        clock_hz = CLOCK_HZ;
    }
}

static void start_uart(void)
{
    RCC_AHB1ENR |= RCC_AHB1ENR_GPIOA;
    RCC_APB1ENR |= RCC_APB1ENR_USART2;
    (void)RCC_APB1ENR;                                     /* a peripheral is ready two cycles after its clock */
    GPIOA_AFRL = (GPIOA_AFRL & ~0xFF00UL) | 0x7700UL;      /* PA2, PA3: alternate function 7 */
    GPIOA_PUPDR = (GPIOA_PUPDR & ~(3UL << 6)) | (1UL << 6); /* PA3: a line that is off reads as silence */
    GPIOA_MODER = (GPIOA_MODER & ~0xCF0UL) | OUT_2_AND_3_ALTERNATE | (1UL << 10); /* PA5: output */
    USART2_BRR = (clock_hz == HSI_HZ) ? DIVIDER(HSI_HZ) : DIVIDER(BUS_HZ);
    USART2_CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
    NVIC_ENABLE_32_TO_63 = 1UL << (USART2_IRQ - 32U);
}

/* Milliseconds and cycles. */
static void start_time(void)
{
    SYSTICK_RELOAD = clock_hz / 1000U - 1U;
    SYSTICK_VALUE = 0U;
    SYSTICK_CONTROL = SYSTICK_RUN;
    DEBUG_CONTROL |= DEBUG_CONTROL_TRACE;
    DWT_CYCLES = 0U;
    DWT_CONTROL |= DWT_CONTROL_CYCLES;
}

void fs_board_init(void)
{
    fs_ring_init(&received, received_octets, RING);
    start_clock();
    start_uart();
    start_time();
    IWDG_KR = IWDG_KR_START; /* and its oscillator, which takes over the next two */
    IWDG_KR = IWDG_KR_UNLOCK;
    IWDG_PR = 0U;     /* 32 kHz by 4 */
    IWDG_RLR = 1000U; /* 125 ms; 85 to 235 ms over the oscillator's range of 17 to 47 kHz */
}

uint32_t fs_board_clock_hz(void)
{
    return clock_hz;
}

uint32_t fs_board_baud(void)
{
    return NUCLEO_BAUD;
}

uint16_t fs_board_was_watchdog(void)
{
    const uint16_t was = ((RCC_CSR & RCC_CSR_IWDGRSTF) != 0U) ? 1U : 0U;

    RCC_CSR |= RCC_CSR_RMVF;
    return was;
}

uint16_t fs_board_receive(fs_octet *octet)
{
    return fs_ring_take(&received, octet);
}

uint16_t fs_board_can_send(void)
{
    return ((USART2_SR & USART_SR_TXE) != 0U) ? 1U : 0U;
}

void fs_board_send(fs_octet octet)
{
    USART2_DR = octet;
}

uint32_t fs_board_overruns(void)
{
    return overruns;
}

uint32_t fs_board_errors(void)
{
    return errors;
}

uint32_t fs_board_now_ms(void)
{
    return milliseconds;
}

uint32_t fs_board_now_us(void)
{
    uint32_t now_ms, left;

    do { /* SysTick may start anew between the two */
        now_ms = milliseconds;
        left = SYSTICK_VALUE;
    } while (now_ms != milliseconds);
    return now_ms * 1000U + (SYSTICK_RELOAD - left) / (clock_hz / 1000000U);
}

uint32_t fs_board_cycles(void)
{
    return DWT_CYCLES;
}

uint32_t fs_board_stack_size(void)
{
    return fs_stack_bytes();
}

uint32_t fs_board_stack_high_water(void)
{
    return fs_stack_used();
}

/* LD2 beats each 512 ms, and flickers while the target is stopped. */
void fs_board_pass(uint32_t now_ms, uint16_t state)
{
    const uint32_t beat = (state == FS_APP_SAFE || state == FS_APP_RESTARTED) ? 0x40U : 0x200U;

    if (now_ms != serviced_ms) {
        serviced_ms = now_ms;
        IWDG_KR = IWDG_KR_RELOAD;
        GPIOA_BSRR = ((now_ms & beat) != 0U) ? LIGHT : (LIGHT << 16);
    }
}
