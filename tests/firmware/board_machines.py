"""Boards in unicorn: the image as it is flashed, its registers in Python, time in cycles. A ``ByteLink`` to the UART.

Registers that a board must not touch raise; those that have no effect here are memory. The clock tree is computed from
what the image writes, so that a wrong divisor is a wrong baud rate, as on the board.
"""

from __future__ import annotations

import ctypes
import functools
from collections import deque
from pathlib import Path
from typing import Any, ClassVar

from unicorn import Uc, UcError, arm_const, riscv_const, unicorn_const
from unicorn.unicorn_py3.unicorn import uclib

from flightstack.firmware.toolchain.build import cached, host_compiler
from flightstack.firmware.toolchain.elf import Elf
from tests.firmware.step_machines import state_flag

C = Path(__file__).parent / "c"
RETURN_AT = 0x1FFF_0000
"""Where a handler returns to."""
LONGEST_BLOCK = 1000


@functools.cache
def time_library() -> ctypes.CDLL:
    """Return the compiled counter of cycles."""
    source = C / "board_time.c"
    return ctypes.CDLL(
        str(
            cached(
                "board_time.so", host_compiler(), ["-O2", "-shared", "-fPIC", state_flag(source)], [source]
            )
        )
    )


class _Time(ctypes.Structure):
    """``board_time`` of board_time.c."""

    _fields_: ClassVar = [
        ("stop", ctypes.c_void_p),
        ("cycles", ctypes.c_uint64),
        ("limit", ctypes.c_uint64),
        ("cycles_per_16_bytes", ctypes.c_uint64),
        ("stopped_at", ctypes.c_uint64),
    ]


class RegisterMisuseError(AssertionError):
    """The image did what the chip does not take."""


class BoardMachine:
    """A processor with flash and RAM; the registers of its chip are methods of a subclass."""

    flash: ClassVar[tuple[int, int]]
    ram_size: ClassVar[int]
    regions: ClassVar[tuple[tuple[int, int], ...]]
    name = "an emulated board"
    is_arm = True

    def __init__(self, image: Path, engine: Uc, slowness: int) -> None:
        """Load ``image``; an instruction takes about ``slowness`` cycles."""
        self.elf, self.engine = Elf(image.read_bytes()), engine
        self.PC = arm_const.UC_ARM_REG_PC if self.is_arm else riscv_const.UC_RISCV_REG_PC
        engine.mem_map(*self.flash, unicorn_const.UC_PROT_READ | unicorn_const.UC_PROT_EXEC)
        engine.mem_map(0x2000_0000, self.ram_size)
        engine.mem_map(RETURN_AT, 0x1000)
        for address, content in self.elf.segments:
            assert self.flash[0] <= address
            assert address + len(content) <= sum(self.flash)
            engine.mem_write(address, content)
        self.values: dict[int, int] = {}
        self.failure: Exception | None = None
        for start, size in self.regions:
            engine.mmio_map(start, size, self._read, start, self._write, start)
        self.arriving: deque[tuple[int, int]] = deque()
        """Cycle of arrival and value of each byte on the line."""
        self.sent: list[int] = []
        self.time = _Time(ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p), 0, 0, 6 * slowness, 0)
        self._hook = ctypes.c_size_t()
        callback = ctypes.cast(time_library().board_time_block, ctypes.c_void_p)
        everywhere = ctypes.c_uint64(1), ctypes.c_uint64(0)
        uclib.uc_hook_add(
            engine._uch, ctypes.byref(self._hook), unicorn_const.UC_HOOK_BLOCK, callback,
            ctypes.byref(self.time), *everywhere,
        )  # fmt: skip

    # ------------------------------------------------------------------ registers

    def _read(self, _engine: Any, offset: int, size: int, start: int) -> int:
        try:
            if size != 4:
                raise RegisterMisuseError(f"read of {size} bytes at {start + offset:#x}")
            return self.read_register(start + offset)
        except Exception as error:
            self._fail(error)
            return 0

    def _write(self, _engine: Any, offset: int, size: int, value: int, start: int) -> None:
        try:
            if size != 4:
                raise RegisterMisuseError(f"write of {size} bytes at {start + offset:#x}")
            self.write_register(start + offset, value)
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.failure = self.failure or error
        self.engine.emu_stop()

    def read_register(self, address: int) -> int:
        """Return a register's value."""
        return self.values.get(address, 0)

    def write_register(self, address: int, value: int) -> None:
        """Write a register."""
        self.values[address] = value

    # ------------------------------------------------------------------ time

    @property
    def cycles(self) -> int:
        """Cycles since the start."""
        return int(self.time.cycles)

    @property
    def clock_hz(self) -> float:
        """Clock of the processor by its registers."""
        raise NotImplementedError

    @property
    def baud(self) -> float:
        """Rate of the UART by its registers."""
        raise NotImplementedError

    def pc(self) -> int:
        """Return where the processor goes on, for the emulator."""
        return self.engine.reg_read(self.PC) | self.is_arm

    def next_event(self) -> int | None:
        """Return the cycle of the next interrupt, None without one."""
        return None

    def handle_events(self) -> None:
        """Run the handlers of interrupts that are due."""

    def run_to(self, cycle: int) -> None:
        """Run the processor up to a cycle, or a basic block longer."""
        while self.cycles < cycle:
            event = self.next_event()
            self.time.limit = cycle if event is None else min(cycle, max(event, self.cycles + 1))
            self.start(self.pc(), 0)
            self.handle_events()

    def start(self, at: int, until: int) -> None:
        """Run the emulator; raise what a register raised."""
        self.time.stopped_at = 0
        try:
            self.engine.emu_start(at, until)
        except UcError as error:
            raise AssertionError(f"the processor stopped at {self.pc():#x}: {error}") from error
        if self.failure is not None:
            raise self.failure
        if self.time.stopped_at:
            self.engine.reg_write(self.PC, self.time.stopped_at)

    # ------------------------------------------------------------------ ByteLink

    def write(self, data: bytes) -> None:
        """Let bytes arrive one after the other at the UART's rate."""
        byte_cycles = 10.0 * self.clock_hz / self.baud
        first = max(self.cycles, self.arriving[-1][0] if self.arriving else 0)
        self.arriving.extend((round(first + (n + 1) * byte_cycles), value) for n, value in enumerate(data))

    def read(self, timeout_s: float) -> bytes:
        """Return bytes that were sent, b"" after the timeout of the board's time."""
        end = self.cycles + max(1, round(timeout_s * self.clock_hz))
        step = round(self.clock_hz * 1e-3)
        while not self.sent and self.cycles < end:
            self.run_to(min(end, self.cycles + step))
        data, self.sent = bytes(self.sent), []
        return data

    def now_s(self) -> float:
        """Return the board's time; its clock must not change any more."""
        return self.cycles / self.clock_hz

    def close(self) -> None:
        """Remove the counter."""
        uclib.uc_hook_del(self.engine._uch, self._hook)


def arm_engine(model: int) -> Uc:
    """Return an engine for a Cortex-M."""
    engine = Uc(unicorn_const.UC_ARCH_ARM, unicorn_const.UC_MODE_THUMB | unicorn_const.UC_MODE_MCLASS)
    engine.ctl_set_cpu_model(model)
    return engine


class Nucleo(BoardMachine):
    """STM32F401RE or STM32F446RE: RCC, flash, GPIO A, USART2, IWDG, SysTick, NVIC, DWT."""

    flash, ram_size = (0x0800_0000, 512 * 1024), 96 * 1024
    regions = ((0x4000_0000, 0x8000), (0x4002_0000, 0x4000), (0xE000_0000, 0x10_0000))
    MAX_HZ: ClassVar = {"nucleo-f401re": (84e6, 2), "nucleo-f446re": (168e6, 5)}
    """Highest clock, and the wait states of the flash there."""

    def __init__(
        self, name: str, image: Path, *, crystal: bool = True, pll: bool = True, watchdog: bool = False,
        slowness: int = 20,
    ) -> None:  # fmt: skip
        """``crystal``, ``pll``: whether HSE and PLL become ready; ``watchdog``: it caused the reset."""
        super().__init__(image, arm_engine(arm_const.UC_CPU_ARM_CORTEX_M4), slowness)
        self._crystal, self._pll, self._limits = crystal, pll, self.MAX_HZ[name]
        self.values = {
            0x4002_3800: 0x83, 0x4002_3804: 0x2400_3010, 0x4002_3874: 0x2600_0000 if watchdog else 0x0E00_0000,
            0x4000_7000: 0x8000, 0x4002_0000: 0xA800_0000, 0xE000_ED88: 0,
        }  # fmt: skip
        self.next_tick: int | None = None
        self.watchdog_s: float | None = None
        self.services = 0
        self.light: list[int] = []
        self._transmits_until = 0
        self._special = {
            0x4002_3800: self._clock_control,
            0x4002_3808: self._clock_switch,
            0x4000_4400: self._uart_status,
            0x4000_4404: self._received,
            0xE000_E018: self._tick_left,
            0xE000_1004: self._cycle_counter,
        }
        stack, reset = (int.from_bytes(engine_read(self.engine, self.flash[0] + at)) for at in (0, 4))
        assert reset & 1
        self.engine.reg_write(arm_const.UC_ARM_REG_SP, stack)
        self.engine.reg_write(arm_const.UC_ARM_REG_PC, reset)

    # ------------------------------------------------------------------ clock tree

    @property
    def clock_hz(self) -> float:
        if self.read_register(0x4002_3808) & 0xC != 8:
            return 16e6
        config = self.values[0x4002_3804]
        source_hz = 8e6 if config >> 22 & 1 else 16e6
        vco_hz = source_hz / (config & 63) * (config >> 6 & 511)
        if (
            not 100e6 <= vco_hz <= 432e6
            or not 1e6 <= source_hz / (config & 63) <= 2e6
            or config >> 28 & 7 < 2
        ):
            raise RegisterMisuseError(f"PLL out of its range: {config:#x}")
        return vco_hz / (2 * (config >> 16 & 3) + 2)

    @property
    def baud(self) -> float:
        dividers = {4: 2, 5: 4, 6: 8, 7: 16}
        bus_hz = self.clock_hz / dividers.get(self.values.get(0x4002_3808, 0) >> 10 & 7, 1)
        if bus_hz > 45e6:
            raise RegisterMisuseError(f"APB1 at {bus_hz:g} Hz")
        return bus_hz / self.values[0x4000_4408]

    # ------------------------------------------------------------------ registers

    def read_register(self, address: int) -> int:
        special = self._special.get(address)
        return self.values.get(address, 0) if special is None else special()

    def _clock_control(self) -> int:
        value = self.values[0x4002_3800]
        ready = (value >> 16 & 1 and self._crystal) << 17 | (value >> 24 & 1 and self._pll) << 25
        return value | ready

    def _clock_switch(self) -> int:
        value = self.values.get(0x4002_3808, 0)
        return value & ~0xC | (value & 3) << 2

    def _uart_status(self) -> int:
        self._check_uart()
        has_come = bool(self.arriving) and self.arriving[0][0] <= self.cycles
        lost = len(self.arriving) > 1 and self.arriving[1][0] <= self.cycles
        return has_come << 5 | (self.cycles >= self._transmits_until) << 7 | lost << 3

    def _tick_left(self) -> int:
        return 0 if self.next_tick is None else max(0, self.next_tick - self.cycles - 1)

    def _cycle_counter(self) -> int:
        return self.cycles & 0xFFFF_FFFF if self.values.get(0xE000_1000, 0) & 1 else 0

    def _received(self) -> int:
        """Return the byte of the data register; the ones that arrived after it are lost."""
        if not self.arriving or self.arriving[0][0] > self.cycles:
            return 0
        _, octet = self.arriving.popleft()
        while self.arriving and self.arriving[0][0] <= self.cycles:
            self.arriving.popleft()
        return octet

    def _check_uart(self) -> None:
        if (
            not self.values.get(0x4002_3840, 0) >> 17 & 1
            or self.values.get(0x4000_440C, 0) & 0x200C != 0x200C
        ):
            raise RegisterMisuseError("USART2 is used before it is on")
        if self.values[0x4002_0000] >> 4 & 15 != 0b1010 or self.values.get(0x4002_0020, 0) >> 8 & 255 != 0x77:
            raise RegisterMisuseError("PA2 and PA3 are not those of USART2")

    def write_register(self, address: int, value: int) -> None:
        self.values[address] = value
        if address == 0x4002_3808 and value & 3 == 2:
            limit_hz, waits = self._limits
            if self.clock_hz > limit_hz or self.values.get(0x4002_3C00, 0) & 15 < waits:
                raise RegisterMisuseError(
                    f"{self.clock_hz:g} Hz with flash at {self.values.get(0x4002_3C00):#x}"
                )
        elif address == 0x4000_4404:
            self._check_uart()
            if self.cycles < self._transmits_until:
                raise RegisterMisuseError("the transmit register is written while it is full")
            self._transmits_until = self.cycles + round(10.0 * self.clock_hz / self.baud)
            self.sent.append(value & 0xFF)
        elif address == 0xE000_E010 and value & 7 == 7:
            self.next_tick = self.cycles + self.values[0xE000_E014] + 1
        elif address == 0x4000_3000 and value == 0xAAAA:
            self.services += 1
            self.watchdog_s = (self.values[0x4000_3008] + 1) * 4.0 / 32e3
        elif address == 0x4002_0018:
            self.light.append(value)

    # ------------------------------------------------------------------ interrupts

    def next_event(self) -> int | None:
        events = [self.next_tick] if self.next_tick is not None else []
        if self._has_receive_interrupt and self.arriving:
            events.append(self.arriving[0][0])
        return min(events, default=None)

    @property
    def _has_receive_interrupt(self) -> bool:
        return bool(self.values.get(0x4000_440C, 0) >> 5 & 1 and self.values.get(0xE000_E104, 0) >> 6 & 1)

    def handle_events(self) -> None:
        if self.next_tick is not None and self.next_tick <= self.cycles:
            self.next_tick += self.values[0xE000_E014] + 1
            self._call(15)
        while self._has_receive_interrupt and self.arriving and self.arriving[0][0] <= self.cycles:
            self._call(16 + 38)

    def _call(self, vector: int) -> None:
        """Run a handler as the processor does, between two basic blocks."""
        engine = self.engine
        context = engine.context_save()
        engine.reg_write(arm_const.UC_ARM_REG_SP, engine.reg_read(arm_const.UC_ARM_REG_SP) - 104 & ~7)
        engine.reg_write(arm_const.UC_ARM_REG_LR, RETURN_AT | 1)
        self.time.limit = self.cycles + 1_000_000
        self.start(int.from_bytes(engine_read(engine, self.flash[0] + 4 * vector)), RETURN_AT)
        engine.context_restore(context)


def engine_read(engine: Uc, address: int) -> bytes:
    """Return a word of memory, most significant byte first."""
    return bytes(engine.mem_read(address, 4))[::-1]
