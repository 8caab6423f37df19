"""Expressions over the signals of a flight, such as ``altitude_m < 12 and mode != 'LAND'``, with their margin.

The margin is the robustness of signal temporal logic: how far the values are from making the expression false (or
true, if it is negative), in the unit of the compared values. ``a < b`` has the margin b − a, ``and`` the smaller one,
``or`` the larger one, ``not`` the negative one; a mode or a flag has an infinite margin.
A. Donzé and O. Maler, "Robust Satisfaction of Temporal Logic over Real-Valued Signals", FORMATS 2010.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.core.portable_math import distance

SIGNALS: dict[str, str] = {
    "time_s": "simulated time",
    "mode": "flight mode, as text: 'MISSION', 'RETURN', 'LAND' …",
    "armed": "true if armed",
    "landed": "true if the land detector reports landed",
    "failsafe": "true if a failsafe acts",
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
    "error_m": "distance between position and position setpoint",
    "battery_percent": "charge of the battery",
}
"""Names in expressions; each is an attribute of ``State`` too."""

Values: TypeAlias = Mapping[str, Any]
_FUNCTIONS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "abs": (abs, np.abs),
    "sqrt": (math.sqrt, np.sqrt),
    "hypot": (distance, np.hypot),
    "min": (min, np.minimum),
    "max": (max, np.maximum),
}
"""For one state, and for arrays."""
_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
_ALLOWED = (
    ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.BinOp, ast.Compare, ast.Call,
    ast.Name, ast.Load, ast.Constant, *_OPERATORS, *_COMPARISONS,
)  # fmt: skip


class Expression:
    """A checked expression. Raise ConfigError for one that is not allowed, with what is.

    >>> Expression("abs(roll_deg) < 35").text
    'abs(roll_deg) < 35'
    """

    def __init__(self, text: str) -> None:
        self.text = text.strip()
        try:
            tree = ast.parse(self.text, mode="eval")
        except (SyntaxError, ValueError) as error:
            raise ConfigError("expression", text, f"is not valid: {getattr(error, 'msg', error)}") from None
        _check(tree, text)
        self._tree = tree.body
        self._code = compile(tree, "<expression>", "eval")
        self.names = tuple(
            sorted({node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in SIGNALS})
        )

    def of_state(self, state: object) -> bool:
        """Return True if the expression holds for one ``State``."""
        values: dict[str, Any] = {name: getattr(state, name) for name in self.names}
        functions = {name: scalar for name, (scalar, _) in _FUNCTIONS.items()}
        return bool(
            eval(self._code, {"__builtins__": {}}, functions | values)
        )  # checked: names and functions above

    def margin(self, signals: Values) -> FloatArray:
        """Return the margin at each sample; ``signals`` are arrays of one length. NaN counts as a violation."""
        margin = np.asarray(_margin(self._tree, signals), dtype=float)
        return np.where(np.isnan(margin), -math.inf, margin)


def _check(tree: ast.Expression, text: str) -> None:
    for node in ast.walk(tree):
        if not isinstance(node, _ALLOWED):
            raise ConfigError("expression", text, f"has {type(node).__name__}, which is not allowed")
        if isinstance(node, ast.Call) and (
            not isinstance(node.func, ast.Name) or node.func.id not in _FUNCTIONS or node.keywords
        ):
            raise ConfigError("expression", text, f"may call {', '.join(_FUNCTIONS)} only")
        if isinstance(node, ast.Name) and node.id not in SIGNALS and node.id not in _FUNCTIONS:
            raise ConfigError(
                "expression", text, f"has an unknown name {node.id}; known are {', '.join(SIGNALS)}"
            )
        if isinstance(node, ast.Constant) and not isinstance(node.value, (int, float, str)):
            raise ConfigError("expression", text, f"has {node.value!r}, which is neither a number nor a text")
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value not in Mode.__members__
        ):
            raise ConfigError(
                "expression", text, f"has no mode {node.value!r}; modes are {', '.join(Mode.__members__)}"
            )


def _margin(node: ast.expr, signals: Values) -> Any:
    if isinstance(node, ast.BoolOp):
        parts = [_margin(part, signals) for part in node.values]
        joined = np.minimum if isinstance(node.op, ast.And) else np.maximum
        return joined.reduce(np.broadcast_arrays(*parts))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return -_margin(node.operand, signals)
    if isinstance(node, ast.Compare):
        values = [_value(part, signals) for part in (node.left, *node.comparators)]
        margins = [
            _compared(operator, a, b) for operator, a, b in zip(node.ops, values, values[1:], strict=False)
        ]
        return np.minimum.reduce(np.broadcast_arrays(*margins))
    return np.where(np.asarray(_value(node, signals), dtype=bool), math.inf, -math.inf)


def _compared(operator: ast.cmpop, a: Any, b: Any) -> Any:
    if isinstance(operator, (ast.Eq, ast.NotEq)):
        sign = 1.0 if isinstance(operator, ast.Eq) else -1.0
        if np.asarray(a).dtype.kind in "fi" and np.asarray(b).dtype.kind in "fi":
            return -sign * np.abs(np.subtract(a, b))
        return sign * np.where(np.asarray(a) == np.asarray(b), math.inf, -math.inf)
    return np.subtract(b, a) if isinstance(operator, (ast.Lt, ast.LtE)) else np.subtract(a, b)


def _value(node: ast.expr, signals: Values) -> Any:
    if isinstance(node, ast.Name):
        return signals[node.id]
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_value(node.operand, signals)
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_value(node.left, signals), _value(node.right, signals))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        arguments = [_value(argument, signals) for argument in node.args]
        function = _FUNCTIONS[node.func.id][1]
        result = arguments[0] if len(arguments) > 1 else function(*arguments)
        for argument in arguments[1:]:  # of two and more
            result = function(result, argument)
        return result
    return _margin(node, signals) >= 0.0
