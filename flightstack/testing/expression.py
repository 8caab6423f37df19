"""Expressions over the signals of a flight, such as ``altitude_m < 12 and mode != 'LAND'``, with their margin.

The margin is the robustness of signal temporal logic: how far the values are from making the expression false (or
true, if it is negative), in the unit of the compared values. ``a < b`` has the margin b − a, ``and`` the smaller one,
``or`` the larger one, ``not`` the negative one; a mode or a flag has an infinite margin. The sign is the truth: equal
values have the smallest positive margin where the comparison is true, else the smallest negative one.
A. Donzé and O. Maler, "Robust Satisfaction of Temporal Logic over Real-Valued Signals", FORMATS 2010.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError

SIGNALS: dict[str, str] = {
    "time_s": "simulated time",
    "mode": "flight mode, as text: 'MISSION', 'RETURN', 'LAND' …",
    "armed": "true if armed",
    "landed": "true if the land detector reports landed",
    "failsafe": "true while a failsafe acts: until its end, a user's override, or disarming",
    "item": "current mission item, from 0",
    "altitude_m": "height above home at the start",
    "north_m": "position north of home at the start",
    "east_m": "position east of home at the start",
    "speed_m_s": "horizontal speed",
    "climb_m_s": "vertical speed, positive upwards",
    "roll_deg": "roll angle",
    "pitch_deg": "pitch angle",
    "yaw_deg": "yaw angle, −180 to 180",
    "distance_to_home_m": "horizontal distance to home",
    "error_m": "distance between true position and position setpoint in flight; 0 on the ground",
    "battery_percent": "charge of the battery",
}
"""Names in expressions; each is an attribute of ``State`` too."""

Values: TypeAlias = Mapping[str, Any]
SMALLEST = 5e-324
"""The smallest positive number: the margin of equal values."""
_LARGEST = 1e300
_ROUNDING = 1e-9
"""Largest relative difference of two equal margins."""
NUMBER, TEXT, CONDITION = "a number", "a mode", "a condition"
_KINDS = {"mode": TEXT, "armed": CONDITION, "landed": CONDITION, "failsafe": CONDITION}
"""What a signal is; the others are numbers."""


def _hypot(a: Any, b: Any) -> Any:
    """Return √(a² + b²) with the same bits on every machine, which libm's hypot has not."""
    return np.sqrt(np.multiply(a, a) + np.multiply(b, b))


_FUNCTIONS: dict[str, tuple[Callable[..., Any], int, float]] = {
    "abs": (np.abs, 1, 1),
    "sqrt": (np.sqrt, 1, 1),
    "hypot": (_hypot, 2, math.inf),
    "min": (np.minimum, 2, math.inf),
    "max": (np.maximum, 2, math.inf),
}
"""Function, and the smallest and largest number of arguments."""
_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
_ORDER, _EQUALITY = (ast.Lt, ast.LtE, ast.Gt, ast.GtE), (ast.Eq, ast.NotEq)
_STRICT = (ast.Lt, ast.Gt, ast.NotEq)


class Expression:
    """A checked condition. Raise ConfigError for one that is not allowed, with what is.

    >>> Expression("abs(roll_deg) < 35").margin({"roll_deg": np.array([5.0, -40.0])}).tolist()
    [30.0, -5.0]
    """

    def __init__(self, text: str) -> None:
        self.text = text.strip()
        try:
            self._tree = ast.parse(self.text, mode="eval").body
            kind = _kind(self._tree, text)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise ConfigError("expression", text, f"is not valid: {getattr(error, 'msg', error)}") from None
        if kind != CONDITION:
            raise ConfigError("expression", text, f"is {kind}, not a condition such as altitude_m < 12")
        self.names = tuple(
            sorted({node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)} & SIGNALS.keys())
        )
        self._truth = _truth(self._tree)

    @property
    def has_no_numbers(self) -> bool:
        """True if the expression is of modes and flags alone."""
        return self._truth is not None

    def of_state(self, state: object) -> bool:
        """Return True if the expression holds for one ``State``; without numbers, for what the vehicle reports."""
        if self._truth is not None:
            return bool(self._truth(state))
        return bool(self.margin({name: getattr(state, name) for name in self.names}) > 0.0)

    def margin(self, signals: Values) -> FloatArray:
        """Return the margin at each sample; ``signals`` are arrays of one length. NaN counts as a violation."""
        with np.errstate(all="ignore"):
            margin = np.asarray(_margin(self._tree, signals), dtype=float)
        return np.where(np.isnan(margin), -math.inf, margin)

    def limit(self, sample: Mapping[str, Any], margin: float) -> float | None:
        """Return the number with which the comparison of this ``margin`` compares; None if it has none.

        ``sample`` has the signals at the time of the margin.

        >>> Expression("hypot(north_m, east_m) < 0.5 and altitude_m > 4.9").limit(
        ...     {"north_m": 0.1, "east_m": 0.0, "altitude_m": 5.9}, 0.4)
        0.5
        """
        if not math.isfinite(margin):
            return None
        limits: dict[float, float | None] = {}
        for node in ast.walk(self._tree):
            if isinstance(node, ast.Compare):
                for operator, pair in zip(node.ops, pairwise((node.left, *node.comparators)), strict=True):
                    found = abs(float(_compared(operator, *(_value(side, sample) for side in pair))))
                    if math.isfinite(found):  # not of modes and flags
                        limits.setdefault(abs(found - abs(margin)), _number(pair))
        nearest = min(limits, default=math.inf)
        return limits[nearest] if nearest <= _ROUNDING * (1.0 + abs(margin)) else None


def _truth(node: ast.expr) -> Callable[[object], Any] | None:
    """Return the function from a state to the value of an expression of modes and flags; None for any other one."""
    if isinstance(node, ast.Name):
        return attrgetter(node.id) if node.id in _KINDS else None
    if isinstance(node, ast.Constant):
        value = node.value
        return (lambda _: value) if isinstance(value, (str, bool)) else None
    operands: Sequence[ast.expr] = ()
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and isinstance(node.ops[0], _EQUALITY):
        operands = (node.left, *node.comparators)
    elif isinstance(node, (ast.BoolOp, ast.UnaryOp)):
        operands = _operands(node)[0]
    parts = [part for operand in operands if (part := _truth(operand)) is not None]
    return _joined(node, parts) if operands and len(parts) == len(operands) else None


def _joined(node: ast.expr, parts: Sequence[Callable[[object], Any]]) -> Callable[[object], Any]:
    """Return the value of an operator of ``_truth`` from those of its operands."""
    if isinstance(node, ast.Compare):
        is_equal = isinstance(node.ops[0], ast.Eq)
        return lambda state: (parts[0](state) == parts[1](state)) is is_equal
    if isinstance(node, ast.BoolOp):
        every = all if isinstance(node.op, ast.And) else any
        return lambda state: every(part(state) for part in parts)
    return lambda state: not parts[0](state)


def _number(sides: Iterable[ast.expr]) -> float | None:
    """Return the value of a side without signals; None if each has some."""
    for side in sides:
        if not any(isinstance(node, ast.Name) and node.id in SIGNALS for node in ast.walk(side)):
            return float(_value(side, {}))
    return None


def _kind(node: ast.expr, text: str) -> str:
    """Return what a node is, after a check of it and its parts; raise ConfigError."""
    if isinstance(node, ast.Name):
        if node.id not in SIGNALS:
            raise ConfigError(
                "expression", text, f"has an unknown name {node.id}; known are {', '.join(SIGNALS)}"
            )
        return _KINDS.get(node.id, NUMBER)
    if isinstance(node, ast.Constant):
        return _constant_kind(node.value, text)
    if isinstance(node, ast.Compare) and all(isinstance(op, _ORDER + _EQUALITY) for op in node.ops):
        orders = any(isinstance(op, _ORDER) for op in node.ops)
        _all([node.left, *node.comparators], NUMBER if orders else _kind(node.left, text), text)
        return CONDITION
    if isinstance(node, ast.Call):
        return _call_kind(node, text)
    operands, kind = _operands(node)
    if not operands:
        raise ConfigError("expression", text, f"has {type(node).__name__}, which is not allowed")
    return _all(operands, kind, text)


def _operands(node: ast.expr) -> tuple[Sequence[ast.expr], str]:
    """Return the operands of an operator and what they must be; none for a node that is no allowed operator."""
    if isinstance(node, ast.BoolOp):
        return node.values, CONDITION
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return (node.left, node.right), NUMBER
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        return (node.operand,), CONDITION if isinstance(node.op, ast.Not) else NUMBER
    return (), ""


def _all(nodes: Sequence[ast.expr], kind: str, text: str) -> str:
    for node in nodes:
        found = _kind(node, text)
        if found != kind:
            raise ConfigError("expression", text, f"has {found} ({ast.unparse(node)}) instead of {kind}")
    return kind


def _constant_kind(value: object, text: str) -> str:
    if isinstance(value, str):
        if value not in Mode.__members__:
            raise ConfigError(
                "expression", text, f"has no mode {value!r}; modes are {', '.join(Mode.__members__)}"
            )
        return TEXT
    if not isinstance(value, (int, float)) or not abs(value) < _LARGEST:
        raise ConfigError("expression", text, f"has {value!r}, which is neither a number nor a text")
    return CONDITION if isinstance(value, bool) else NUMBER


def _call_kind(node: ast.Call, text: str) -> str:
    name = node.func.id if isinstance(node.func, ast.Name) else ""
    if name not in _FUNCTIONS or node.keywords:
        raise ConfigError("expression", text, f"may call {', '.join(_FUNCTIONS)} only")
    _, fewest, most = _FUNCTIONS[name]
    if not fewest <= len(node.args) <= most:
        wanted = f"{fewest}" if most == fewest else f"{fewest} or more"
        raise ConfigError(
            "expression", text, f"has {name} with {len(node.args)} arguments instead of {wanted}"
        )
    return _all(node.args, NUMBER, text)


def _margin(node: ast.expr, signals: Values) -> Any:
    """Return the margin of a condition; NaN where it is unknown."""
    if isinstance(node, ast.BoolOp):
        parts = np.broadcast_arrays(*(_margin(part, signals) for part in node.values))
        return _all_of(parts) if isinstance(node.op, ast.And) else -_all_of([-part for part in parts])
    if isinstance(node, ast.UnaryOp):
        return -_margin(node.operand, signals)
    if isinstance(node, ast.Compare):
        values = [_value(part, signals) for part in (node.left, *node.comparators)]
        margins = [
            _compared(operator, a, b) for operator, a, b in zip(node.ops, values, values[1:], strict=False)
        ]
        return _all_of(np.broadcast_arrays(*margins))
    return np.where(np.asarray(_value(node, signals), dtype=bool), math.inf, -math.inf)


def _all_of(parts: Sequence[Any]) -> Any:
    """Return the smallest margin: unknown if a part is and no other one is violated."""
    known = np.fmin.reduce(parts)
    return np.where(known < 0.0, known, np.minimum.reduce(parts))


def _compared(operator: ast.cmpop, a: Any, b: Any) -> Any:
    if isinstance(operator, _EQUALITY):
        sign = 1.0 if isinstance(operator, ast.Eq) else -1.0
        if np.asarray(a).dtype.kind not in "fiu":
            return sign * np.where(np.asarray(a) == np.asarray(b), math.inf, -math.inf)
        margin = np.asarray(-sign * np.abs(np.subtract(a, b)))
    else:
        less = isinstance(operator, (ast.Lt, ast.LtE))
        margin = np.asarray(np.subtract(b, a) if less else np.subtract(a, b))
    return np.where(margin == 0.0, -SMALLEST if isinstance(operator, _STRICT) else SMALLEST, margin)


def _value(node: ast.expr, signals: Values) -> Any:
    if isinstance(node, ast.Name):
        return signals[node.id]
    if isinstance(node, ast.Constant):
        is_number = isinstance(node.value, (int, float)) and not isinstance(node.value, bool)
        return float(node.value) if is_number else node.value  # type: ignore[arg-type]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return np.negative(_value(node.operand, signals))
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_value(node.left, signals), _value(node.right, signals))
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        function, fewest, _ = _FUNCTIONS[node.func.id]
        arguments = [_value(argument, signals) for argument in node.args]
        return function(*arguments) if fewest == 1 else reduce(function, arguments)
    return _margin(node, signals) > 0.0
