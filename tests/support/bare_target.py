"""An emulated target without the estimator, whose compilation takes three quarters of the time of an image."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

from flightstack.firmware.sources import PORTABLE, SENSING_INCLUDES, c_files
from flightstack.firmware.toolchain import cortex_m4
from flightstack.firmware.toolchain.build import includes

STUB = Path(__file__).resolve().parents[1] / "firmware" / "c" / "no_sensing.c"


def _image() -> Path:
    sources = [path for folder in PORTABLE for path in c_files(folder)]
    # another image for the cache, and another one for another stub
    flags = [
        *includes(*SENSING_INCLUDES),
        f"-DWITHOUT_ESTIMATOR=0x{hashlib.sha256(STUB.read_bytes()).hexdigest()[:15]}",
    ]
    return cortex_m4.emulated_image("emulated.elf", [*sources, STUB], "emulated.c", flags=flags)


@contextlib.contextmanager
def without_estimator() -> Iterator[None]:
    """Let ``--loops emulated`` start a target without the estimator: for tests of control laws."""
    with mock.patch.object(cortex_m4, "cortex_m4_image", _image):
        yield
