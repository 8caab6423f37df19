"""How much a thing holds in memory, and how much work a call is: counted, not timed."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable
from types import BuiltinFunctionType, FrameType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

_LEAVES = (int, float, str, bool, type(None), np.ndarray, np.generic, ModuleType, type, BuiltinFunctionType)

_OURS = ("flightstack", "gcs_cli", "sim_bridge", "pymavlink", "tests")
"""Modules whose objects are looked into; a compiler's caches are not a link's memory."""


def held(*roots: object) -> int:
    """Count the objects and octets that can be reached from ``roots``: what grows without bound shows here."""
    seen: set[int] = set()
    waiting: list[object] = list(roots)
    total = 0
    while waiting:
        thing = waiting.pop()
        if isinstance(thing, (bytes, bytearray)):
            total += len(thing)
        if isinstance(thing, _LEAVES) or id(thing) in seen:
            continue
        seen.add(id(thing))
        total += 1
        waiting.extend(_inside(thing))
    return total


def _inside(thing: Any) -> list[object]:
    if isinstance(thing, dict):
        return [*thing.keys(), *thing.values()]
    if isinstance(thing, (list, tuple, set, frozenset, deque)):
        return list(thing)
    if isinstance(thing, MethodType):
        return [thing.__self__]
    if isinstance(thing, FunctionType):
        return [cell.cell_contents for cell in thing.__closure__ or ()]
    if not type(thing).__module__.startswith(_OURS):
        return []
    slots = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    return [*getattr(thing, "__dict__", {}).values(), *(getattr(thing, name, None) for name in slots)]


def calls(action: Callable[[], object]) -> int:
    """Count the calls that ``action`` makes, of Python and of C functions."""
    count = 0

    def note(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        action()
    finally:
        sys.setprofile(None)
    return count
