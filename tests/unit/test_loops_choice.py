"""The word behind ``--loops``."""

from __future__ import annotations

import pytest

from flightstack.core.errors import ConfigError
from flightstack.firmware.choice import LoopsChoice, parse_loops


@pytest.mark.parametrize(
    ("word", "choice", "is_target"),
    [
        ("python", LoopsChoice("python"), False),
        ("c", LoopsChoice("c"), False),
        ("host", LoopsChoice("host"), True),
        ("emulated", LoopsChoice("emulated"), True),
        ("serial:/dev/ttyACM0", LoopsChoice("serial", "/dev/ttyACM0", 115_200), True),
        ("serial:/dev/ttyUSB1:921600", LoopsChoice("serial", "/dev/ttyUSB1", 921_600), True),
        (
            "serial:/dev/serial/by-path/usb-0:1.4:1.0",
            LoopsChoice("serial", "/dev/serial/by-path/usb-0:1.4:1.0"),
            True,
        ),
        ("host,short", LoopsChoice("host", ending="short"), True),
        ("serial:/dev/ttyUSB1:921600,free", LoopsChoice("serial", "/dev/ttyUSB1", 921_600, "free"), True),
        ("emulated,short", LoopsChoice("emulated", ending="short"), True),
        ("serial:/dev/ttyUSB1:921600,short", LoopsChoice("serial", "/dev/ttyUSB1", 921_600, "short"), True),
        ("serial:a,b,short", LoopsChoice("serial", "a,b", 115_200, "short"), True),
        ("serial:x:1200", LoopsChoice("serial", "x", 1_200), True),
        ("serial:loop:name:2500000", LoopsChoice("serial", "loop:name", 2_500_000), True),
    ],
)
def test_a_word_is_read(word: str, choice: LoopsChoice, is_target: bool) -> None:
    assert parse_loops(word) == choice
    assert parse_loops(word).is_target is is_target


NO_WORDS = (
    *("", "C", "python:", "host:/dev/pts/1", "serial", "serial:", "serial::9600", "serial:x:1199"),
    *("python,short", "c,short", "host,", "host,long", "host:,short"),
)


@pytest.mark.parametrize("word", [*NO_WORDS, "serial:x:20000001", "serial:x:" + "9" * 5000])
def test_another_word_is_refused(word: str) -> None:
    with pytest.raises(ConfigError, match=r"^--loops(: | is not one of python)"):
        parse_loops(word)
