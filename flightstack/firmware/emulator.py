"""Emulated Cortex-M4F: unicorn runs an image and counts its instructions, behind a ``ByteLink``.

Host memory is mapped into the emulated machine, so an exchange is one call: the mailbox
(``firmware/ports/cortex_m4/fs_mailbox.h``) is filled, the target runs from ``fs_emulated_exchange`` to
``fs_emulated_stop``, and the mailbox is read.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import numpy as np
from unicorn import Uc, UcError, arm_const, unicorn_const
from unicorn.unicorn_py3.unicorn import uclib

from flightstack.firmware.pil.record import Trace
from flightstack.firmware.toolchain.coverage import merged
from flightstack.firmware.toolchain.elf import Elf, ElfError

FLASH_AT, FLASH_SIZE = 0x0000_0000, 512 * 1024
RAM_AT, RAM_SIZE = 0x2000_0000, 128 * 1024
MAILBOX_AT, MAILBOX_SIZE = 0x4000_0000, 20 * 1024
MAX_RECEIVED, MAX_SENT = 4096, 12288
LONGEST_RUN = 100_000_000
"""Maximum instructions per run; a step takes some thousands."""
MOST_RUNS = 1000
"""Maximum runs per exchange."""
PAINT = 0xA5
_THUMB = 1


class EmulationError(RuntimeError):
    """The emulated target cannot be loaded, faulted, or did not return."""


class Mailbox(ctypes.Structure):
    """The fields of ``fs_mailbox``."""

    _fields_: ClassVar = [
        ("instructions", ctypes.c_uint32),
        ("now_ms", ctypes.c_uint32),
        ("received_length", ctypes.c_uint32),
        ("sent_length", ctypes.c_uint32),
        ("more", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 3),
        ("received", ctypes.c_ubyte * MAX_RECEIVED),
        ("sent", ctypes.c_ubyte * MAX_SENT),
    ]


class _Counter(ctypes.Structure):
    """The fields of ``fs_counter`` before its table of blocks."""

    _fields_: ClassVar = [
        ("clock", ctypes.c_void_p),
        ("code", ctypes.c_void_p),
        ("stop", ctypes.c_void_p),
        ("code_size", ctypes.c_uint32),
        ("uncounted", ctypes.c_uint32),
        ("limit", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


_BLOCK = np.dtype([("size", "u4"), ("instructions", "u4")])
"""One entry of the table of blocks in ``fs_counter``, for each half-word of code; size 0: never run."""


class Emulator:
    """One emulated processor with an image in its flash."""

    def __init__(self, image: Path, counter: Path) -> None:
        """Load ``image`` (ELF); ``counter`` is the library of ``emulator_counter.c``. Raise EmulationError."""
        try:
            elf = Elf(image.read_bytes())
            self._start, self._stop = elf.symbols["fs_emulated_exchange"], elf.symbols["fs_emulated_stop"]
            self._stack = range(elf.symbols["fs_stack_bottom"], elf.symbols["fs_stack_top"])
            clock = elf.symbols["fs_port_clock"]
        except (ElfError, OSError, KeyError) as error:
            raise EmulationError(f"{image}: cannot be emulated: {error}") from error
        self._flash = (ctypes.c_ubyte * FLASH_SIZE)()
        self._ram = (ctypes.c_ubyte * RAM_SIZE)()
        bottom, top = self._stack.start - RAM_AT, self._stack.stop - RAM_AT
        self._ram[bottom:top] = [PAINT] * (top - bottom)
        self._memory = (ctypes.c_ubyte * MAILBOX_SIZE)()
        self.mailbox = Mailbox.from_buffer(self._memory)
        self._received = memoryview(self._memory).cast("B")[Mailbox.received.offset :]
        self._sent = memoryview(self._memory).cast("B")[Mailbox.sent.offset :]
        for address, content in elf.segments:
            if not address + len(content) <= FLASH_SIZE:
                raise EmulationError(f"{image}: has content at {address:#x}, outside the flash")
            self._flash[address : address + len(content)] = list(content)
        self._engine = self._machine()
        self._count(counter, clock & ~_THUMB)

    def _machine(self) -> Uc:
        engine = Uc(unicorn_const.UC_ARCH_ARM, unicorn_const.UC_MODE_THUMB | unicorn_const.UC_MODE_MCLASS)
        engine.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        read_write = unicorn_const.UC_PROT_READ | unicorn_const.UC_PROT_WRITE
        read_execute = unicorn_const.UC_PROT_READ | unicorn_const.UC_PROT_EXEC
        for address, held, rights in (
            (FLASH_AT, self._flash, read_execute),
            (RAM_AT, self._ram, read_write),
            (MAILBOX_AT, self._memory, read_write),
        ):
            engine.mem_map_ptr(address, len(held), rights, ctypes.addressof(held))
        return engine

    def _count(self, library: Path, clock: int) -> None:
        """Register the compiled counter for all blocks; a Python callback would cost more than a block."""
        counting = ctypes.CDLL(str(library))
        self._table = ctypes.create_string_buffer(counting.fs_counter_size())
        self._counter = _Counter.from_buffer(self._table)
        self._counter.clock = ctypes.addressof(self.mailbox)
        self._counter.code = ctypes.addressof(self._flash)
        self._counter.stop = ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p)
        self._counter.code_size, self._counter.uncounted = FLASH_SIZE, clock
        callback = ctypes.cast(counting.fs_counter_block, ctypes.c_void_p)
        self._hook = ctypes.c_size_t()
        everywhere = ctypes.c_uint64(1), ctypes.c_uint64(0)
        status = uclib.uc_hook_add(
            self._engine._uch,
            ctypes.byref(self._hook),
            unicorn_const.UC_HOOK_BLOCK,
            callback,
            ctypes.byref(self._counter),
            *everywhere,
        )
        if status != unicorn_const.UC_ERR_OK:
            raise EmulationError(f"unicorn rejected the instruction counter: error {status}")

    def exchange(self, data: bytes, now_ms: int) -> bytes:
        """Pass ``data`` to the target at time ``now_ms`` and return its output; raise EmulationError."""
        pieces = range(0, max(1, len(data)), MAX_RECEIVED)
        answers = [self._run(data[at : at + MAX_RECEIVED], now_ms) for at in pieces]
        while self.mailbox.more:
            answers.append(self._run(b"", now_ms))
            if len(answers) > len(pieces) + MOST_RUNS:
                raise EmulationError("the emulated target sends endlessly")
        return b"".join(answers)

    def _run(self, data: bytes, now_ms: int) -> bytes:
        mailbox = self.mailbox
        self._received[: len(data)] = data
        mailbox.received_length, mailbox.now_ms = len(data), now_ms & 0xFFFF_FFFF
        self._counter.limit = (mailbox.instructions + LONGEST_RUN) & 0xFFFF_FFFF
        self._engine.reg_write(arm_const.UC_ARM_REG_SP, self._stack.stop)
        try:
            self._engine.emu_start(self._start | _THUMB, self._stop & ~_THUMB)
        except UcError as error:
            place = self._engine.reg_read(arm_const.UC_ARM_REG_PC)
            raise EmulationError(f"the emulated target stopped at {place:#010x}: {error}") from error
        if self._engine.reg_read(arm_const.UC_ARM_REG_PC) != self._stop & ~_THUMB:
            raise EmulationError(f"the emulated target did not return within {LONGEST_RUN} instructions")
        return bytes(self._sent[: min(mailbox.sent_length, MAX_SENT)])

    def close(self) -> None:
        """Remove the counter; the machine must not run afterwards."""
        uclib.uc_hook_del(self._engine._uch, self._hook)  # unicorn's wrapper only removes its own hooks

    @property
    def executed(self) -> list[tuple[int, int]]:
        """Addresses of the code that ran: first and end of each range."""
        blocks = np.frombuffer(memoryview(self._table), _BLOCK, offset=ctypes.sizeof(_Counter))
        places = np.flatnonzero(blocks["size"])
        return merged(2 * places, blocks["size"][places])

    @property
    def stack_high_water(self) -> int:
        """Maximum stack use [bytes]."""
        bottom, top = self._stack.start - RAM_AT, self._stack.stop - RAM_AT
        untouched = bytes(self._ram[bottom:top])
        return top - bottom - (len(untouched) - len(untouched.lstrip(bytes([PAINT]))))


class EmulatedTarget:
    """A ``ByteLink`` to an emulated image.

    The target's clock is simulated: ``now_s``, for example the flight's time, or else the time that its host spent
    waiting. A ``read`` without data returns at once and advances that clock by its timeout.
    """

    name = "emulated Cortex-M4F"

    def __init__(self, image: Path, counter: Path, now_s: Callable[[], float] | None = None) -> None:
        """Load the image; ``counter`` is the instruction counter's library. Raise EmulationError."""
        self._image = image
        self._emulator = Emulator(image, counter)
        self._now_s = now_s
        self._waited_s = 0.0
        self._sent = b""

    def _exchange(self, data: bytes) -> None:
        now_s = self._waited_s if self._now_s is None else self._now_s()
        self._sent += self._emulator.exchange(data, round(now_s * 1000.0))

    def write(self, data: bytes) -> None:
        """Send ``data`` and run the target until it waits for more; raise EmulationError."""
        self._exchange(data)

    def read(self, timeout_s: float) -> bytes:
        """Return the target's output, b"" after ``timeout_s`` of its time without any."""
        if not self._sent:
            self._waited_s += timeout_s
            self._exchange(b"")
        sent, self._sent = self._sent, b""
        return sent

    def close(self) -> None:
        """Stop the target."""
        self._emulator.close()

    @property
    def instructions(self) -> int:
        """Instructions executed since the start, modulo 2**32."""
        return int(self._emulator.mailbox.instructions)

    @property
    def trace(self) -> Trace:
        """The image, and its code that ran until now."""
        return Trace(str(self._image), self._emulator.executed)

    @property
    def stack_high_water(self) -> int:
        """Maximum stack use [bytes]."""
        return self._emulator.stack_high_water
