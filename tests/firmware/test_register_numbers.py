"""Registers of the Nucleo and Pico 2 ports against the vendors' headers, where these are.

STM32: ``CMSIS_DEVICE_F4_ROOT`` (github.com/STMicroelectronics/cmsis_device_f4) and ``CMSIS_CORE_ROOT``
(github.com/STMicroelectronics/cmsis_core). RP2350: ``PICO_SDK_PATH`` (github.com/raspberrypi/pico-sdk).
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from tests.firmware.codec_support import ROOT, compiler

PORTS = ROOT / "firmware" / "ports"
DEFINE = re.compile(r"^#define (\w+)(\(pin\))? (.+?)(?: /\*.*)?$", re.MULTILINE)

STM32 = {
    **{f"RCC_{name}": f"&RCC->{name}" for name in ("CR", "PLLCFGR", "CFGR", "AHB1ENR", "APB1ENR", "CSR")},
    **{f"RCC_CR_{name}": f"RCC_CR_{name}" for name in ("HSEON", "HSERDY", "HSEBYP", "PLLON", "PLLRDY")},
    "RCC_PLLCFGR_HSE": "RCC_PLLCFGR_PLLSRC_HSE",
    **{f"RCC_CFGR_{name}": f"RCC_CFGR_{name}" for name in ("SW_PLL", "SWS", "SWS_PLL")},
    "RCC_CFGR_PPRE1_2": "RCC_CFGR_PPRE1_DIV2",
    "RCC_CFGR_PPRE1_4": "RCC_CFGR_PPRE1_DIV4",
    "RCC_CFGR_PPRE2_2": "RCC_CFGR_PPRE2_DIV2",
    "RCC_AHB1ENR_GPIOA": "RCC_AHB1ENR_GPIOAEN",
    "RCC_APB1ENR_USART2": "RCC_APB1ENR_USART2EN",
    "RCC_APB1ENR_PWR": "RCC_APB1ENR_PWREN",
    "RCC_CSR_RMVF": "RCC_CSR_RMVF",
    "RCC_CSR_IWDGRSTF": "RCC_CSR_IWDGRSTF",
    "PWR_CR": "&PWR->CR",
    "PWR_CR_VOS": "PWR_CR_VOS",
    "FLASH_ACR": "&FLASH->ACR",
    "FLASH_ACR_CACHES": "FLASH_ACR_PRFTEN | FLASH_ACR_ICEN | FLASH_ACR_DCEN",
    "FLASH_ACR_LATENCY": "FLASH_ACR_LATENCY",
    **{f"GPIOA_{name}": f"&GPIOA->{name}" for name in ("MODER", "PUPDR", "BSRR")},
    "GPIOA_AFRL": "&GPIOA->AFR[0]",
    **{f"USART2_{name}": f"&USART2->{name}" for name in ("SR", "DR", "BRR", "CR1")},
    "USART_SR_DAMAGED": "USART_SR_PE | USART_SR_FE | USART_SR_NE",
    **{f"USART_SR_{name}": f"USART_SR_{name}" for name in ("ORE", "RXNE", "TXE")},
    **{f"USART_CR1_{name}": f"USART_CR1_{name}" for name in ("RE", "TE", "RXNEIE", "UE")},
    "USART2_IRQ": "USART2_IRQn",
    **{f"IWDG_{name}": f"&IWDG->{name}" for name in ("KR", "PR", "RLR")},
    "SYSTICK_CONTROL": "&SysTick->CTRL",
    "SYSTICK_RELOAD": "&SysTick->LOAD",
    "SYSTICK_VALUE": "&SysTick->VAL",
    "SYSTICK_RUN": "SysTick_CTRL_CLKSOURCE_Msk | SysTick_CTRL_TICKINT_Msk | SysTick_CTRL_ENABLE_Msk",
    "NVIC_ENABLE_32_TO_63": "&NVIC->ISER[1]",
    "FPU_ACCESS": "&SCB->CPACR",
    "DEBUG_CONTROL": "&CoreDebug->DEMCR",
    "DEBUG_CONTROL_TRACE": "CoreDebug_DEMCR_TRCENA_Msk",
    "DWT_CONTROL": "&DWT->CTRL",
    "DWT_CONTROL_CYCLES": "DWT_CTRL_CYCCNTENA_Msk",
    "DWT_CYCLES": "&DWT->CYCCNT",
}
STM32_LEFT = {"IWDG_KR_RELOAD", "IWDG_KR_UNLOCK", "IWDG_KR_START"}
"""Keys of the watchdog, which the headers lack: they are in stm32f4xx_hal_iwdg.h."""

RP2350 = {
    "CLK_REF_CTRL_AT": "CLOCKS_BASE + CLOCKS_CLK_REF_CTRL_OFFSET",
    "CLK_REF_FROM_XOSC": "CLOCKS_CLK_REF_CTRL_SRC_VALUE_XOSC_CLKSRC",
    "CLK_REF_SELECTED": "CLOCKS_BASE + CLOCKS_CLK_REF_SELECTED_OFFSET",
    "CLK_SYS_CTRL_AT": "CLOCKS_BASE + CLOCKS_CLK_SYS_CTRL_OFFSET",
    "CLK_SYS_FROM_AUX": "CLOCKS_CLK_SYS_CTRL_SRC_VALUE_CLKSRC_CLK_SYS_AUX",
    "CLK_SYS_SELECTED": "CLOCKS_BASE + CLOCKS_CLK_SYS_SELECTED_OFFSET",
    "CLK_PERI_CTRL": "CLOCKS_BASE + CLOCKS_CLK_PERI_CTRL_OFFSET",
    "CLK_PERI_ENABLE": "CLOCKS_CLK_PERI_CTRL_ENABLE_BITS",
    "PSM_WDSEL": "PSM_BASE + PSM_WDSEL_OFFSET",
    "PSM_WDSEL_ALL": "PSM_WDSEL_BITS",
    "PSM_WDSEL_OSCILLATORS": "PSM_WDSEL_ROSC_BITS | PSM_WDSEL_XOSC_BITS",
    "RESETS_AT": "RESETS_BASE + RESETS_RESET_OFFSET",
    "RESETS_DONE": "RESETS_BASE + RESETS_RESET_DONE_OFFSET",
    **{
        f"RESETS_{name}": f"RESETS_RESET_{name}_BITS"
        for name in ("IO_BANK0", "PADS_BANK0", "PLL_SYS", "TIMER0", "UART0")
    },
    "IO_BANK0_CTRL": "IO_BANK0_BASE + IO_BANK0_GPIO1_CTRL_OFFSET",
    "IO_UART": "IO_BANK0_GPIO1_CTRL_FUNCSEL_VALUE_UART0_RX",
    "IO_SIO": "IO_BANK0_GPIO1_CTRL_FUNCSEL_VALUE_SIOB_PROC_1",
    "PADS_BANK0": "PADS_BANK0_BASE + PADS_BANK0_GPIO1_OFFSET",
    "PAD_OUTPUT": "PADS_BANK0_GPIO1_IE_BITS | (1 << PADS_BANK0_GPIO1_DRIVE_LSB) | PADS_BANK0_GPIO1_SCHMITT_BITS",
    "PAD_INPUT_PULLED_UP": "PADS_BANK0_GPIO1_IE_BITS | (1 << PADS_BANK0_GPIO1_DRIVE_LSB) | "
    "PADS_BANK0_GPIO1_SCHMITT_BITS | PADS_BANK0_GPIO1_PUE_BITS",
    "XOSC_CTRL": "XOSC_BASE + XOSC_CTRL_OFFSET",
    "XOSC_ENABLE_1_TO_15_MHZ": "(XOSC_CTRL_ENABLE_VALUE_ENABLE << XOSC_CTRL_ENABLE_LSB) | "
    "XOSC_CTRL_FREQ_RANGE_VALUE_1_15MHZ",
    "XOSC_STATUS": "XOSC_BASE + XOSC_STATUS_OFFSET",
    "XOSC_STABLE": "XOSC_STATUS_STABLE_BITS",
    "XOSC_STARTUP": "XOSC_BASE + XOSC_STARTUP_OFFSET",
    "PLL_SYS_CS": "PLL_SYS_BASE + PLL_CS_OFFSET",
    "PLL_LOCK": "PLL_CS_LOCK_BITS",
    "PLL_SYS_PWR_AT": "PLL_SYS_BASE + PLL_PWR_OFFSET",
    "PLL_PWR_CORE": "PLL_PWR_PD_BITS | PLL_PWR_VCOPD_BITS",
    "PLL_PWR_DIVIDERS": "PLL_PWR_POSTDIVPD_BITS",
    "PLL_SYS_FBDIV": "PLL_SYS_BASE + PLL_FBDIV_INT_OFFSET",
    "PLL_SYS_PRIM": "PLL_SYS_BASE + PLL_PRIM_OFFSET",
    "UART0_DR": "UART0_BASE + UART_UARTDR_OFFSET",
    "UART_DR_DAMAGED": "UART_UARTDR_FE_BITS | UART_UARTDR_PE_BITS | UART_UARTDR_BE_BITS",
    "UART_DR_OVERRUN": "UART_UARTDR_OE_BITS",
    "UART0_FR": "UART0_BASE + UART_UARTFR_OFFSET",
    "UART_FR_RECEIVE_EMPTY": "UART_UARTFR_RXFE_BITS",
    "UART_FR_TRANSMIT_FULL": "UART_UARTFR_TXFF_BITS",
    "UART0_IBRD": "UART0_BASE + UART_UARTIBRD_OFFSET",
    "UART0_FBRD": "UART0_BASE + UART_UARTFBRD_OFFSET",
    "UART0_LCR_H": "UART0_BASE + UART_UARTLCR_H_OFFSET",
    "UART_8N1_WITH_FIFO": "(3 << UART_UARTLCR_H_WLEN_LSB) | UART_UARTLCR_H_FEN_BITS",
    "UART0_CR": "UART0_BASE + UART_UARTCR_OFFSET",
    "UART_ENABLE": "UART_UARTCR_RXE_BITS | UART_UARTCR_TXE_BITS | UART_UARTCR_UARTEN_BITS",
    "TIMER0_RAW_LOW": "TIMER0_BASE + TIMER_TIMERAWL_OFFSET",
    "TICKS_TIMER0_CTRL": "TICKS_BASE + TICKS_TIMER0_CTRL_OFFSET",
    "TICKS_TIMER0_CYCLES": "TICKS_BASE + TICKS_TIMER0_CYCLES_OFFSET",
    "TICKS_WATCHDOG_CTRL": "TICKS_BASE + TICKS_WATCHDOG_CTRL_OFFSET",
    "TICKS_WATCHDOG_CYCLES": "TICKS_BASE + TICKS_WATCHDOG_CYCLES_OFFSET",
    "WATCHDOG_CTRL_AT": "WATCHDOG_BASE + WATCHDOG_CTRL_OFFSET",
    "WATCHDOG_ENABLE": "WATCHDOG_CTRL_ENABLE_BITS",
    "WATCHDOG_LOAD": "WATCHDOG_BASE + WATCHDOG_LOAD_OFFSET",
    "WATCHDOG_REASON": "WATCHDOG_BASE + WATCHDOG_REASON_OFFSET",
    "WATCHDOG_REASON_TIMER": "WATCHDOG_REASON_TIMER_BITS",
    "SIO_OUT_SET": "SIO_BASE + SIO_GPIO_OUT_SET_OFFSET",
    "SIO_OUT_CLEAR": "SIO_BASE + SIO_GPIO_OUT_CLR_OFFSET",
    "SIO_OE_SET": "SIO_BASE + SIO_GPIO_OE_SET_OFFSET",
    "SIO_MTIME_CTRL": "SIO_BASE + SIO_MTIME_CTRL_OFFSET",
    "SIO_MTIME_EVERY_CYCLE": "SIO_MTIME_CTRL_EN_BITS | SIO_MTIME_CTRL_FULLSPEED_BITS",
    "SIO_MTIME_LOW": "SIO_BASE + SIO_MTIME_OFFSET",
}
RP2350_HEADERS = (
    *("addressmap", "clocks", "psm", "resets", "io_bank0", "pads_bank0", "xosc", "pll", "uart"),
    *("timer", "ticks", "watchdog", "sio"),
)


def numbers(folder: Path, includes: str, expressions: dict[str, str], *flags: str) -> dict[str, int]:
    """Return the values of C expressions by name, as a host's compiler reads them; addresses count as numbers."""
    lines = [
        f'    (void)printf("{name} %lu\\n", (unsigned long)({text}) & 0xFFFFFFFFUL);'
        for name, text in expressions.items()
    ]
    source, program = folder / "numbers.c", folder / "numbers"
    body = "\n".join(lines)
    source.write_text(f"#include <stdio.h>\n{includes}\nint main(void)\n{{\n{body}\n    return 0;\n}}\n")
    subprocess.run([*compiler(), "-w", "-O1", *flags, str(source), "-o", str(program)], check=True)
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return {name: int(number) for name, number in (line.split() for line in text.splitlines())}


def own(folder: Path, header: Path) -> dict[str, int]:
    """Return the registers' addresses and the bits of a port's header."""
    expressions = {}
    for name, pin, text in DEFINE.findall(header.read_text()):
        used = f"{name}(1UL)" if pin else name
        expressions[name] = f"&{used}" if "_REGISTER(" in text else used
    return numbers(folder, f'#include "{header}"', expressions)


def root_of(variable: str) -> Path:
    if not os.environ.get(variable):
        pytest.skip(f"{variable} is not set: the registers are not checked against the vendor's headers")
    return Path(os.environ[variable])


@pytest.mark.parametrize("device", ["stm32f401xe", "stm32f446xx"])
def test_stm32_registers_are_those_of_cmsis(device: str, tmp_path: Path) -> None:
    folders = [root_of("CMSIS_DEVICE_F4_ROOT") / "Include", root_of("CMSIS_CORE_ROOT") / "Core/Include"]
    expected = numbers(tmp_path, f'#include "{device}.h"', STM32, *(f"-I{folder}" for folder in folders))
    found = own(tmp_path, PORTS / "nucleo" / "nucleo_registers.h")
    assert found.keys() - expected.keys() == STM32_LEFT
    if device == "stm32f401xe":
        assert expected["FLASH_ACR_LATENCY"] == 7  # RM0368 has a fourth bit, which this chip has no use for
        expected["FLASH_ACR_LATENCY"] = 15
    assert {name: found[name] for name in expected} == expected


def test_rp2350_registers_are_those_of_the_pico_sdk(tmp_path: Path) -> None:
    folder = root_of("PICO_SDK_PATH") / "src/rp2350/hardware_regs/include"
    includes = "\n".join(f'#include "hardware/regs/{name}.h"' for name in RP2350_HEADERS)
    expected = numbers(tmp_path, "#define _u(x) x ## u\n" + includes, RP2350, f"-I{folder}")
    found = own(tmp_path, PORTS / "pico2" / "pico2_registers.h")
    assert found == expected
