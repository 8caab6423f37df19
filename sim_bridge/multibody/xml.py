"""Helpers to write MJCF with ElementTree."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeAlias
from xml.etree.ElementTree import Element, SubElement

Value: TypeAlias = str | float | Iterable[float]


def text(value: Value) -> str:
    """Format a value for MJCF: numbers with nine digits, separated by spaces."""
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return f"{value:.9g}"
    return " ".join(f"{number:.9g}" for number in value)


def exact(values: Iterable[float]) -> str:
    """Format numbers without loss."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def add(parent: Element, tag: str, **attributes: Value) -> Element:
    """Append an element; a trailing underscore of a name is dropped, as in ``class_``.

    ``euler`` [rad, intrinsic x-y-z] is written as ``quat``, whose meaning does not depend on ``compiler``.
    """
    element = SubElement(parent, tag)
    for name, value in attributes.items():
        if name == "euler" and not isinstance(value, str | float | int):
            element.set("quat", text(_quaternion(*value)))
        else:
            element.set(name.rstrip("_"), text(value))
    return element


def section(root: Element, tag: str) -> Element:
    """Return the section of the model with this name; create it if it does not exist."""
    found = root.find(tag)
    return found if found is not None else SubElement(root, tag)


def add_visual(parent: Element, kind: str, **attributes: Value) -> Element:
    """Append a visual geom: no contact, no mass."""
    return add(parent, "geom", type=kind, contype=0, conaffinity=0, mass=0, group=2, **attributes)


def _quaternion(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the quaternion of intrinsic rotations about x, y, z [rad]."""
    cx, sx = math.cos(x / 2.0), math.sin(x / 2.0)
    cy, sy = math.cos(y / 2.0), math.sin(y / 2.0)
    cz, sz = math.cos(z / 2.0), math.sin(z / 2.0)
    return (
        cx * cy * cz - sx * sy * sz,
        sx * cy * cz + cx * sy * sz,
        cx * sy * cz - sx * cy * sz,
        cx * cy * sz + sx * sy * cz,
    )
