"""The F28377S port against TI's own headers, where C2000Ware is installed: C2000WARE_ROOT=/path/to/it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.firmware.codec_support import compiler
from tests.firmware.f28377s_support import INCLUDE, OWN_DRIVERLIB, PORT, ti_flags, ti_folders

CONSTANT = re.compile(r"^#define ([A-Z]\w+) (\d\w*|GPIO_\w+)$", re.MULTILINE)
MEMBER = re.compile(r"\b((?:SCI|SYSCTL|GPIO)_\w+) = (\w+)")


def said_of(source: Path, launchpad: str = "F28377S") -> str:
    """Return what the compiler says of a file read with TI's headers; "" is content."""
    if ti_folders() is None:
        pytest.skip("C2000WARE_ROOT is not set: the port is not checked against TI's headers here")
    ti = ti_flags(f"f2837x{launchpad[-1].lower()}", launchpad)
    strict = [
        "-std=gnu99",
        "-fsyntax-only",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wstrict-prototypes",
        "-Werror",
    ]
    command = [*compiler(), *strict, *ti, *INCLUDE, str(source)]
    return subprocess.run(command, check=False, capture_output=True, text=True).stderr


@pytest.mark.parametrize("launchpad", ["F28377S", "F28379D"])
@pytest.mark.parametrize("source", sorted(PORT.glob("*.c")), ids=lambda path: path.name)
def test_the_port_compiles_with_the_headers_of_ti(source: Path, launchpad: str) -> None:
    """Every call has the parameters, and every constant the type, that driverlib declares."""
    assert said_of(source, launchpad) == ""


def test_the_fake_has_the_constants_of_ti(tmp_path: Path) -> None:
    """Each number that the fake defines is the one in TI's headers: checked by TI's headers, at compile time."""
    text = "".join(path.read_text() for path in sorted(OWN_DRIVERLIB.glob("*.h")))
    numbers = dict(CONSTANT.findall(text)) | dict(MEMBER.findall(text))
    assert len(numbers) > 40
    source = tmp_path / "constants.c"
    lines = [
        f'_Static_assert((unsigned long)({name}) == {value}, "{name}");' for name, value in numbers.items()
    ]
    source.write_text('#include "driverlib.h"\n#include "device.h"\n' + "\n".join(lines))
    assert said_of(source) == ""


def test_a_wrong_constant_would_be_seen(tmp_path: Path) -> None:
    source = tmp_path / "wrong.c"
    source.write_text('#include "driverlib.h"\n_Static_assert(SCI_INT_TXFF == 0x10U, "SCI_INT_TXFF");\n')
    assert "SCI_INT_TXFF" in said_of(source)
