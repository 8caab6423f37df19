"""The events of a flight given to the estimator in single precision on host, emulated Cortex-M4F and AVR."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.firmware.c_filter import FOLDERS, filter_sources
from flightstack.firmware.emulator import MAX_RECEIVED, Emulator
from flightstack.firmware.toolchain.build import EXACT, cached, host_compiler, includes
from flightstack.firmware.toolchain.cortex_m4 import emulated_image, instruction_counter
from tests.firmware.step_machines import avr_program, hashes, run, run_avr
from tests.support.filter_events import Event

C = Path(__file__).parent / "c"
INCLUDES = [*includes(*FOLDERS), f"-I{C}"]
PARTS = (
    "predict", "predict yaw models", "drift of GNSS", "fuse GNSS velocity", "fuse GNSS position", "fuse field",
    "fuse barometer", "fuse range", "fuse drag", "fuse rest velocity", "fuse rest rate", "fuse hold",
    "update yaw models", "follow", "predict errors",
)  # fmt: skip
"""Parts of the filter in the order of filter_steps.c; of a sensor one axis."""


_SMALL = (
    "-mcall-prologues", "-fno-inline", "-fno-tree-pre", "-fno-gcse", "-fno-tree-ter", "-fno-ivopts",
    "-fno-tree-loop-optimize",
)  # fmt: skip
"""Flags with which code and stack fit beside the memory: 119 of 128 KiB of flash, 1.6 of 1.9 KiB of stack."""


class FilterCosts(NamedTuple):
    """Instructions of a sample of the IMU: mean, the most, the least (the output alone); and of each part."""

    mean: float
    most: int
    least: int
    parts: dict[str, int]


def stream_of(events: Sequence[Event]) -> bytes:
    """Return the octets of events as filter_steps.c reads them."""
    return b"".join(
        struct.pack(f"<BB{len(event.row)}f", event.kind, len(event.row), *event.row) for event in events
    )


def _sources(last: str) -> list[Path]:
    return [*filter_sources(), C / "filter_steps.c", C / last]


def _state_flag() -> str:
    content = b"".join(path.read_bytes() for path in sorted(C.glob("filter_*")))
    return f"-DFILTER_STATE=0x{hashlib.sha256(content).hexdigest()[:15]}"


def on_host(stream: bytes, folder: Path) -> np.ndarray:
    """Return the hashes of this machine."""
    flags = [*EXACT, *INCLUDES, _state_flag()]
    program = cached("filter_host", host_compiler(), flags, _sources("filter_host.c"))
    (folder / "events").write_bytes(stream)
    run([program, folder / "events", folder / "host"])
    return hashes((folder / "host").read_bytes())


def on_cortex_m4(stream: bytes) -> tuple[np.ndarray, FilterCosts]:
    """Return the hashes of the emulated Cortex-M4F, and the costs."""
    image = emulated_image("filter.elf", _sources("filter_cortex_m4.c"), flags=[*INCLUDES, _state_flag()])
    emulator = Emulator(image, instruction_counter())
    pieces = (stream[at : at + MAX_RECEIVED] for at in range(0, len(stream), MAX_RECEIVED))
    made = hashes(b"".join([*(emulator.exchange(piece, 0) for piece in pieces), emulator.exchange(b"", 0)]))
    end = len(made) - 4 - 16
    samples, total, most, least = (int(number) for number in made[end : end + 4])
    parts = {name: int(cost) for name, cost in zip(PARTS, made[end + 4 :], strict=False)}
    return made[:end], FilterCosts(total / samples, most, least, parts)


def on_avr(stream: bytes, folder: Path) -> np.ndarray:
    """Return the hashes of a simulated ATmega1284P, whose 128 KiB of flash hold the filter compiled for size."""
    flags = ["-Os", *_SMALL, *(flag for flag in EXACT if flag != "-O2"), *INCLUDES]
    return run_avr(avr_program("filter_avr.elf", *flags, *_sources("filter_avr.c")), stream, folder)
