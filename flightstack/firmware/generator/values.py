"""Expressions of C with their types."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from flightstack.firmware.generator.types import BOOL, INT, REAL, WHOLE, Record, Type


class Form(Enum):
    """Form of a value in the text of C."""

    VALUE = "value"
    """A number, or a structure that has an address."""
    POINTER = "pointer"
    """A pointer to a structure."""
    MADE = "made"
    """A structure that a call returns."""
    FIELDS = "fields"
    """A structure by the values of its fields."""


ATOM, UNARY, PRODUCT, SUM, ORDER, EQUAL, AND, OR, CHOICE = 10, 9, 8, 7, 6, 5, 4, 3, 2
"""Precedence in C, larger binds more tightly."""


@dataclass(frozen=True)
class Value:
    """An expression."""

    type: Type
    text: str
    rank: int = ATOM
    form: Form = Form.VALUE
    fields: tuple[Value, ...] = ()
    literal: int | float | bool | None = None
    """The value of a literal in the source."""
    is_constant: bool = False
    """True for a constant of a module."""
    root: str = ""
    """Variable that the value is a part of."""
    callee: str = ""
    """Function that returned the value."""
    owner: Value | None = None
    """The structure of which the value is a field."""

    def within(self, rank: int) -> str:
        """Return the text as an operand of an operator of this rank."""
        return f"({self.text})" if self.rank < rank else self.text

    @property
    def is_simple(self) -> bool:
        """True if the text may be repeated: it has no operator and no call."""
        return self.rank == ATOM and "(" not in self.text.removeprefix("FS_LIT(")

    def item(self) -> str:
        """Return the text of the value itself, for an assignment or a list of initial values."""
        if self.form is Form.POINTER:
            return f"*{self.text}"
        if self.form is Form.FIELDS:
            return "{" + ", ".join(value.item() for value in self.fields) + "}"
        return self.text


def real_literal(value: float) -> Value:
    """Return a float constant."""
    if math.isnan(value):
        return Value(REAL, "FS_NAN", literal=value)
    if math.isinf(value):
        return Value(REAL, "FS_INFINITY" if value > 0.0 else "-FS_INFINITY", ATOM if value > 0.0 else UNARY)
    return Value(REAL, f"FS_LIT({float(value)!r})", literal=float(value))  # a NumPy scalar has another repr


def int_literal(value: int) -> Value:
    """Return an integer constant."""
    return Value(INT, str(value), ATOM if value >= 0 else UNARY, literal=value)


def bool_literal(value: bool) -> Value:
    """Return true or false."""
    return Value(BOOL, "true" if value else "false", literal=value)


def as_real(value: Value) -> Value:
    """Return an integer as a float; a float unchanged."""
    if value.type in (REAL, WHOLE):
        return replace(value, type=REAL)
    if isinstance(value.literal, int):
        return real_literal(float(value.literal))
    return replace(value, type=REAL, text=f"(fs_real){value.within(UNARY)}", rank=UNARY, literal=None)


def as_whole(value: Value) -> Value:
    """Return an integer as C keeps those of ``math.floor``."""
    return replace(as_real(value), type=WHOLE)


def field_of(record: Value, name: str, kind: Type) -> Value:
    """Return a field of a structure that has an address."""
    arrow = "->" if record.form is Form.POINTER else "."
    return Value(kind, f"{record.text}{arrow}{name}", root=record.root, owner=record)


def address(value: Value) -> str:
    """Return the address of a structure."""
    assert isinstance(value.type, Record)
    return value.text if value.form is Form.POINTER else f"&{value.text}"
