"""The F28377S port on a simulated chip: TI's driverlib or the tests' own over its registers, driven octet by octet."""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from flightstack.mavlink.dialect import mavlink
from tests.firmware.codec_support import ROOT, WARNINGS, compiler
from tests.firmware.kept_builds import kept_build

FIRMWARE = ROOT / "firmware"
PORT = FIRMWARE / "ports" / "f28377s"
FAKE = Path(__file__).parent / "c" / "f28377s_chip"
OWN_DRIVERLIB = FAKE / "own"
PORTABLE = [file for part in ("core", "mavlink", "app") for file in sorted((FIRMWARE / part).glob("*.c"))]
RING = FIRMWARE / "ports" / "bare" / "fs_ring.c"
INCLUDE = [
    f"-I{folder}" for folder in (*(FIRMWARE / part for part in ("core", "mavlink", "app")), RING.parent, PORT)
]

CYCLES_PER_S = 200_000_000
FRAMING, BREAK, PAUSE, OVERRUN = 0x100, 0x200, 0x400, 0x800
"""What the line brings in place of an octet; FRAMING goes with one."""
LEVEL, EDGE = 0, 1
POWER_ON, WATCHDOG = 3, 4
INT_TIMER0, INT_RECEIVED, INT_SENT = 0x00260107, 0x00600901, 0x00610902
HEARTBEAT_LIGHT, SAFE_LIGHT = 12, 13
LIT, DARK = 0, 1


PORT_SOURCES = [RING, *sorted(file for file in PORT.glob("*.c") if file.name != "f28_main.c")]
FLAGS = ["-fPIC", "-O2", *WARNINGS, *INCLUDE]


def compiled(name: str, *words: str | Path) -> Path:
    """Compile with the host's compiler."""
    return kept_build(name, tuple(compiler()), *words)


def portable() -> Path:
    """Return what all targets have in common as one object."""
    return compiled("portable.o", "-r", *FLAGS, *PORTABLE)


def ti_folders(family: str = "f2837xs") -> list[Path] | None:
    """Return where TI's driverlib and its headers are; None without C2000Ware."""
    root = os.environ.get("C2000WARE_ROOT", "")
    if not root:
        return None
    return [
        Path(root, "driverlib", family, "driverlib"),
        Path(root, "device_support", family, "common/include"),
    ]


def ti_flags(family: str = "f2837xs", launchpad: str = "F28377S") -> list[str]:
    """Return the options for TI's headers; they say what cl2000 would have known."""
    system = [word for folder in ti_folders(family) or () for word in ("-isystem", str(folder))]
    return ["-include", str(FAKE / "ti_shim.h"), f"-D_LAUNCHXL_{launchpad}", "-DCPU1", *system]


@functools.cache
def chip_flags() -> list[str]:
    """Return the options for driverlib over the simulated chip: TI's where there is C2000Ware, else the tests' own."""
    return [f"-I{FAKE}", *(["-DTI_REGISTERS", *ti_flags()] if ti_folders() else [f"-I{OWN_DRIVERLIB}"])]


def chip() -> Path:
    """Return the simulated chip and driverlib as one object."""
    folders = ti_folders()
    names = ("sci.c", "interrupt.c", "gpio.c")
    library = [OWN_DRIVERLIB / "vectors.c"] if folders is None else [folders[0] / name for name in names]
    objects = [
        compiled(f"{path.stem}.o", "-c", "-fPIC", "-O2", "-w", *chip_flags(), path) for path in library
    ]
    model = [*sorted(FAKE.glob("fake_*.c")), *objects]
    return compiled("chip.o", "-r", *FLAGS, "-fno-strict-aliasing", *chip_flags(), *model)


@functools.cache
def built(*options: str) -> Path:
    """Return a library of the port, driverlib and the simulated chip for a set of options; main is left out."""
    sources = [portable(), chip(), *PORT_SOURCES, FAKE / "bench.c"]
    here = [*chip_flags(), '-DF28_BOARD="simulated chip"', *options]
    return compiled("port.so", "-shared", *FLAGS, *here, *sources)


class Board:
    """A chip that was just switched on, with the port's program on it."""

    def __init__(
        self,
        folder: Path,
        *,
        flags: int = LEVEL,
        cause: int = POWER_ON,
        timer1: int = 0xFFFFFFFF,
        start: bool = True,
        options: Sequence[str] = (),
    ) -> None:
        """Load a copy of the program, so that its memory is its own; ``flags`` is LEVEL or EDGE, see fake.h."""
        copy = folder / f"port-{len(list(folder.glob('port-*.so')))}.so"
        shutil.copy(built(*options), copy)
        self.c: Any = ctypes.CDLL(str(copy))
        self.c.fake_time.restype = self.c.fake_octet_cycles.restype = ctypes.c_uint64
        self.c.fake_misuse.restype = ctypes.c_char_p
        for name in ("f28_cycles", "f28_now_ms", "f28_serial_overruns", "f28_serial_errors", "fake_sent"):
            getattr(self.c, name).restype = ctypes.c_uint32
        for name in ("f28_serial_take", "f28_serial_room", "f28_serial_give"):
            getattr(self.c, name).restype = ctypes.c_uint16
        for name in ("fake_line_waits", "fake_watchdog_bites", "fake_pin", "f28_stack_high_water"):
            getattr(self.c, name).restype = ctypes.c_uint32
        self.c.fake_power_on(flags, cause, timer1)
        self.parser = mavlink.MAVLink(None)
        self.parser.robust_parsing = True
        if start:
            self.c.f28_start()

    def line(self, octets: Iterable[int]) -> None:
        """Let the line bring these, one after the other without a gap, from now on."""
        items = list(octets)
        self.c.fake_line((ctypes.c_uint16 * len(items))(*items), len(items))

    def run(self, *, ms: float = 0.0, octets: float = 0.0, work: int = 200) -> None:
        """Run the main loop for a time; a pass takes ``work`` cycles besides its calls of driverlib."""
        self.c.bench_passes(round(ms * CYCLES_PER_S / 1e3 + octets * self.c.fake_octet_cycles()), work)

    def idle(self, *, ms: float = 0.0, octets: float = 0.0) -> None:
        """Let time pass without the main loop; interrupts come through."""
        self.c.fake_run(round(ms * CYCLES_PER_S / 1e3 + octets * self.c.fake_octet_cycles()))

    def sent(self) -> list[int]:
        """Take what left on the line."""
        room = (ctypes.c_uint16 * 65536)()
        return list(room[: self.c.fake_sent(room, 65536)])

    def messages(self) -> list[Any]:
        """Take what left on the line, as pymavlink reads it; what is no message comes as BAD_DATA."""
        return self.parser.parse_buffer(bytes(self.sent())) or []

    def take(self, room: int = 600) -> list[int]:
        """Take received octets from the port, in place of the application."""
        out = (ctypes.c_uint16 * room)()
        return list(out[: self.c.f28_serial_take(out, room)])

    def give(self, octets: Sequence[int]) -> int:
        """Queue octets to be sent, in place of the application."""
        taken: int = self.c.f28_serial_give((ctypes.c_uint16 * len(octets))(*octets), len(octets))
        return taken

    def c_words(self, name: str, count: int) -> Any:
        """Return an array of the program, to be looked at and changed."""
        return (ctypes.c_uint16 * count).in_dll(self.c, name)

    @property
    def overruns(self) -> int:
        """Return what the port counted as lost."""
        return int(self.c.f28_serial_overruns())

    @property
    def errors(self) -> int:
        """Return what the port counted as errors of the line."""
        return int(self.c.f28_serial_errors())

    def nothing_misused(self) -> None:
        """Fail with the first thing that the port did and the chip would not have liked."""
        assert self.c.fake_misuse() == b""


def pil_step(number: int, flags: int, position: Sequence[float] = (0.0, 0.0, -5.0)) -> bytes:
    """Return the frame of a step that hovers at a place, with the outer loop due."""
    state = [*position, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.01, -0.02, 0.0]
    setpoint = [0.1, 0.0, -5.0, *[0.0] * 8]
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    packed: bytes = mavlink.MAVLink_fs_pil_step_message(number, flags, state, setpoint).pack(link)
    return packed
