"""The Pico 2 in unicorn: registers of the RP2350, on both of its processors."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import ClassVar

from unicorn import Uc, arm_const, riscv_const, unicorn_const

from tests.firmware.board_machines import BoardMachine, RegisterMisuseError, arm_engine, engine_read


class Pico2(BoardMachine):
    """RP2350: resets, XOSC, PLL, clocks, IO, UART0 with FIFOs, TIMER0, watchdog, SIO."""

    flash, ram_size = (0x1000_0000, 4 * 1024 * 1024), 512 * 1024
    regions = ((0x4001_0000, 0x10_0000), (0xD000_0000, 0x1000), (0xE000_0000, 0x10_0000))
    ALIASED: ClassVar = range(0x4001_0000, 0x4010_C000)
    FIFO = 32

    def __init__(self, image: Path, *, watchdog: bool = False, slowness: int = 20) -> None:
        """``watchdog``: it caused the reset."""
        self.is_arm = int.from_bytes(image.read_bytes()[18:20], "little") == 40
        engine = (
            arm_engine(arm_const.UC_CPU_ARM_CORTEX_M33)
            if self.is_arm
            else Uc(unicorn_const.UC_ARCH_RISCV, unicorn_const.UC_MODE_RISCV32)
        )
        super().__init__(image, engine, slowness)
        self.values = {
            0x4002_0000: 0x1FFF_FFFF, 0x4005_0004: 0x2D, 0x400D_8008: int(watchdog), 0xD000_01A4: 0xD,
        }  # fmt: skip
        self.values |= {0x4003_8004 + 4 * pin: 0x116 for pin in range(48)}
        self.services, self.light = 0, list[int]()
        self._received: deque[int] = deque()
        self._drained_at = 0.0
        self._is_uart_checked = False
        self._special = {
            0x4002_0008: lambda: ~self.values[0x4002_0000] & 0x1FFF_FFFF,
            0x4004_8004: lambda: (self.values.get(0x4004_8000, 0) == 0xFA_BAA0) << 31,
            0x4001_0038: lambda: 1 << (self.values.get(0x4001_0030, 0) & 3),
            0x4001_0044: lambda: 1 << (self.values.get(0x4001_003C, 0) & 1),
            0x4005_0000: lambda: (
                self.values.get(0x4005_0000, 0) | (self.values[0x4005_0004] & 0x21 == 0) << 31
            ),
            0x400B_0028: self._microseconds,
            0xD000_01B0: lambda: self.cycles & 0xFFFF_FFFF if self.values[0xD000_01A4] & 3 == 3 else 0,
            0x4007_0000: self._take,
            0x4007_0018: self._flags,
        }
        self._boot()

    def _boot(self) -> None:
        """Start the image as the boot ROM does: by the block in its first 4 KiB."""
        block = bytes(self.engine.mem_read(self.flash[0], 4096))
        at = block.index(bytes.fromhex("d3deffff"))
        assert at % 4 == 0
        words = [int.from_bytes(block[at + 4 * n : at + 4 * n + 4], "little") for n in range(8)]
        if self.is_arm:
            assert words[1:5] == [0x1021_0142, 0x1FF, 0, 0xAB12_3579]
            stack, reset = (int.from_bytes(engine_read(self.engine, self.flash[0] + n)) for n in (0, 4))
            assert reset & 1
            self.engine.reg_write(arm_const.UC_ARM_REG_SP, stack)
            self.engine.reg_write(arm_const.UC_ARM_REG_PC, reset)
        else:
            assert words[1:3] == [0x1101_0142, 0x344]
            assert words[5:] == [0x4FF, 0, 0xAB12_3579]
            self.engine.reg_write(riscv_const.UC_RISCV_REG_SP, words[4])
            self.engine.reg_write(riscv_const.UC_RISCV_REG_PC, words[3])

    # ------------------------------------------------------------------ clock tree

    @property
    def clock_hz(self) -> float:
        if not self.values.get(0x4001_003C, 0) & 1:
            return 11e6 if self.values.get(0x4001_0030, 0) & 3 != 2 else 12e6
        prim, vco_hz = self.values[0x4005_000C], 12e6 * self.values[0x4005_0008]
        if not 750e6 <= vco_hz <= 1600e6 or self.values[0x4005_0004] & 0x29:
            raise RegisterMisuseError(f"PLL at {vco_hz:g} Hz, power {self.values[0x4005_0004]:#x}")
        return vco_hz / (prim >> 16 & 7) / (prim >> 12 & 7)

    @property
    def baud(self) -> float:
        divider = self.values[0x4007_0024] + self.values[0x4007_0028] / 64.0
        return self.clock_hz / 16.0 / divider

    # ------------------------------------------------------------------ registers

    def _is_out_of_reset(self, bit: int) -> bool:
        return not self.values[0x4002_0000] >> bit & 1

    def read_register(self, address: int) -> int:
        special = self._special.get(address)
        return self.values.get(address, 0) if special is None else special()

    def _microseconds(self) -> int:
        if not self._is_out_of_reset(23) or self.values.get(0x4010_8018) != 1:
            raise RegisterMisuseError("TIMER0 is read before it ticks")
        return int(self.cycles / self.clock_hz * 12e6 / self.values[0x4010_801C]) & 0xFFFF_FFFF

    def _check_uart(self) -> None:
        """Check what the UART needs, once after each change of a register."""
        if self._is_uart_checked:
            return
        needed = (
            all(self._is_out_of_reset(bit) for bit in (6, 9, 26))
            and self.values.get(0x4001_0048, 0) >> 11 & 1
        )
        if not needed or self.values.get(0x4007_0030, 0) & 0x301 != 0x301:
            raise RegisterMisuseError("UART0 is used before it is on")
        if self.values.get(0x4007_002C) != 0x70:
            raise RegisterMisuseError("UART0 is not 8N1 with its FIFOs")
        if any(self.values.get(0x4002_8004 + 8 * pin) != 2 for pin in (0, 1)):
            raise RegisterMisuseError("GP0 and GP1 are not those of UART0")
        if (
            any(self.values[0x4003_8004 + 4 * pin] & 0x100 for pin in (0, 1))
            or not self.values[0x4003_8008] & 0x40
        ):
            raise RegisterMisuseError("the pads of GP0 and GP1 are isolated")
        self._byte_cycles = 10.0 * self.clock_hz / self.baud
        self._is_uart_checked = True

    def _fill(self) -> None:
        while self.arriving and self.arriving[0][0] <= self.cycles:
            _, octet = self.arriving.popleft()
            if len(self._received) < self.FIFO:
                self._received.append(octet)
            else:
                self._received[-1] |= 0x800

    def _take(self) -> int:
        self._check_uart()
        self._fill()
        return self._received.popleft() if self._received else 0

    def _flags(self) -> int:
        self._check_uart()
        self._fill()
        waiting = (self._drained_at - self.cycles) / self._byte_cycles
        return (not self._received) << 4 | (waiting > self.FIFO) << 5

    def write_register(self, address: int, value: int) -> None:
        if address in self.ALIASED and address & 0x3000 and not 0x4010_8000 <= address < 0x4010_9000:
            plain, old = address & ~0x3000, self.values.get(address & ~0x3000, 0)
            alias = address & 0x3000
            value = {0x1000: old ^ value, 0x2000: old | value, 0x3000: old & ~value}[alias]
            address = plain
        self.values[address] = value
        self._is_uart_checked &= address >= 0x400D_0000 or address == 0x4007_0000
        if address == 0x4007_0000:
            if self._flags() & 0x20:
                raise RegisterMisuseError("the transmit FIFO is written while it is full")
            self._drained_at = max(self._drained_at, self.cycles) + self._byte_cycles
            self.sent.append(value & 0xFF)
        elif address == 0x400D_8004:
            self.services += 1
        elif address in (0xD000_0018, 0xD000_0020):
            self.light.append(address)
