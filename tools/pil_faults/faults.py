"""The planted faults: a number of the target that is wrong, or one passage of the C core written otherwise."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from flightstack.firmware.sources import firmware_root

PID, BACKSTEPPING = "pid", "backstepping"
_GAIN_ERROR = 1.01
_NOT_GAINS = ("FS_CTRL", "FS_ROTORS", "FS_OUTER_DIV")


class Fault(NamedTuple):
    """One fault: ``factor`` on the number ``name``, or ``wrong`` in place of ``right`` in ``file``."""

    title: str
    kind: str
    controller: str
    """The controller that it is replayed with."""
    name: str = ""
    factor: float = 1.0
    file: str = ""
    right: str = ""
    wrong: str = ""


MISSING, UNIT, DELAY, SWAPPED, SIGN, LIMIT, SCALE = (
    "term missing", "wrong unit", "delay", "swapped", "sign", "limit", "number 1 % off",
)  # fmt: skip
KINDS = (SCALE, MISSING, UNIT, DELAY, SWAPPED, SIGN, LIMIT)
_PASSAGES = Path(__file__).with_name("passages.toml")


def structural() -> Iterator[Fault]:
    """Yield the faults of the source; raise ValueError if the source has changed where one is planted."""
    with _PASSAGES.open("rb") as file:
        for entry in tomllib.load(file)["fault"]:
            fault = Fault(**{"controller": PID, **entry})
            if (firmware_root() / "core" / fault.file).read_text().count(fault.right) != 1:
                raise ValueError(f"{fault.file} has changed: plant {fault.title!r} anew")
            yield fault


def scaled(numbers: Mapping[str, Mapping[str, float]]) -> Iterator[Fault]:
    """Yield each number of the target 1 % off; ``numbers`` by controller. Zeros and counts are left out.

    A number of both controllers is planted with the first only, unless the first law does not use it.
    """
    seen: set[str] = set()
    for controller, values in numbers.items():
        for name, value in values.items():
            if name in seen or not value or name in _NOT_GAINS or _is_unused(name, controller):
                continue
            seen.add(name)
            factor = 2.0 - _GAIN_ERROR if _at_its_largest(name) else _GAIN_ERROR
            yield Fault(name, SCALE, controller, name=name, factor=factor)


def _is_unused(name: str, controller: str) -> bool:
    of_backstepping = name.startswith(("BS_", "FS_JR", "FS_SPIN"))
    return (of_backstepping and controller == PID) or (name.startswith("PID_") and controller != PID)


def _at_its_largest(name: str) -> bool:
    """Return True if the default is the largest allowed value, so that only a smaller one can be set."""
    return name.endswith("_FF") or name.startswith("FS_SPIN")
