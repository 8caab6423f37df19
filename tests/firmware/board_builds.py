"""Images of boards, built with every warning."""

from __future__ import annotations

from pathlib import Path

from flightstack.firmware.toolchain.boards import (
    ARM_GCC,
    GCC,
    STRICT,
    board_image,
)
from tests.firmware.step_machines import tool


def image(name: str, compiler: str, *flags: str) -> Path:
    if compiler == GCC:
        tool(ARM_GCC, "gcc-arm-none-eabi")
    return board_image(name, compiler, extra=[*STRICT, *flags])
