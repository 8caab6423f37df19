"""Translation of calls."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flightstack.core import portable_math
from flightstack.firmware.generator.law import Function, python_function
from flightstack.firmware.generator.text import identifier
from flightstack.firmware.generator.types import (
    BOOL,
    INT,
    NOTHING,
    REAL,
    WHOLE,
    Array,
    Record,
    Several,
    Single,
    Type,
    c_size,
    c_type,
    is_record,
)
from flightstack.firmware.generator.values import (
    ATOM,
    CHOICE,
    UNARY,
    Form,
    Value,
    address,
    as_real,
    field_of,
    real_literal,
)

if TYPE_CHECKING:
    from flightstack.firmware.generator.expressions import Expressions
    from flightstack.firmware.generator.writer import Writer

_MATH = {
    math.sqrt: ("fs_sqrt", 1),
    math.fabs: ("fs_abs", 1),
    math.floor: ("fs_floor", 1),
    math.copysign: ("fs_copysign", 2),
}
_TESTS = {math.isfinite: "fs_is_finite", math.isnan: "fs_is_nan"}
_MIN_MAX = {min: "fs_min", max: "fs_max"}


class Calls:
    """Translates the calls of one function."""

    def __init__(self, function: Function, writer: Writer, expressions: Expressions) -> None:
        self.function, self.writer, self.expressions = function, writer, expressions

    def call(self, node: ast.Call, alone: bool = False) -> Value:
        """Return the result of a call; ``alone`` if it is a statement of its own or the value of an assignment."""
        target = self.expressions.constant(node.func)
        if is_record(target):
            return self.expressions.constructor(node, target)
        if isinstance(target, type) or inspect.isbuiltin(target):
            return self._built_in(node, target)
        if python_function(target) is None:
            is_method = isinstance(node.func, ast.Attribute) and not inspect.isroutine(target)
            construct = "method call" if is_method else "function call"
            raise self.function.refusal(node, construct, f"call of {ast.unparse(node.func)}")
        callee = self.callee(node, target)
        if isinstance(callee.result, Several):
            raise self.function.refusal(node, "tuple", f"result of {callee.name} as one value")
        if callee.part:
            return self._part(node, callee)
        if callee.written and not alone:
            raise self.function.refusal(node, "call that writes to an array")
        text = f"{callee.c_name}({', '.join(self.arguments(node, callee))})"
        form = Form.MADE if isinstance(callee.result, Record) else Form.VALUE
        return Value(callee.result, text, ATOM, form, callee=callee.name.strip("_"))

    def _part(self, node: ast.Call, callee: Function) -> Value:
        """Return the part of a record that a function takes of its parameter."""
        (parameter,) = callee.parameters
        (record,) = self.bound(node, [(parameter.name, parameter.type)], {})
        return field_of(record, callee.part, callee.result)

    def callee(self, node: ast.Call, target: Any) -> Function:
        """Return the translated function that a call names."""
        is_compiled = hasattr(target, "py_func") or target in portable_math.FUNCTIONS
        if not is_compiled and not self.writer.unit.program.accepts_plain:
            raise self.function.refusal(
                node, "function call", f"{ast.unparse(node.func)} is not marked @compiled"
            )
        return self.writer.unit.require(self.function, node, target)

    def arguments(self, node: ast.Call, callee: Function) -> list[str]:
        """Return the C arguments of a call, without out-parameters."""
        types = [(parameter.name, parameter.type) for parameter in callee.parameters]
        defaults = {p.name: (callee, p.default) for p in callee.parameters if p.default is not None}
        values = self.bound(node, types, defaults)
        texts = []
        for (name, kind), value in zip(types, values, strict=True):
            if isinstance(kind, Record | Single):
                held = value if value.form in (Form.VALUE, Form.POINTER) else self.writer.hoist(value, name)
                texts.append(address(held))
            else:
                texts.append(_array_argument(kind, value, name in callee.written))
            if name in callee.sized:
                assert isinstance(value.type, Array)
                size = self.writer.size_of(value) or self.expressions.size(node, value.type.shape[0])
                texts.append(size.text)
            if name in callee.written:
                self.writer.write_to(node, value)
            if name in callee.bounds:
                self._check_bound(node, callee, name)
        if callee.needs_rotors:
            texts.append(self.writer.rotors())
        return texts

    def _check_bound(self, node: ast.Call, callee: Function, name: str) -> None:
        """Accept an argument that may bound a loop of this function too, or the default of a parameter."""
        names = [parameter.name for parameter in callee.parameters]
        given = dict(zip(names, node.args, strict=False)) | {str(k.arg): k.value for k in node.keywords}
        if name not in given or self.expressions.bounds.accepts(given[name]):
            return
        raise self.function.refusal(node, "loop bound", f"loop bound {name} of {ast.unparse(node.func)}")

    def bound(
        self,
        node: ast.Call,
        parameters: Sequence[tuple[str, Type]],
        defaults: Mapping[str, tuple[Function, ast.expr | None]],
    ) -> list[Value]:
        """Return the values of parameters in their order, evaluated in the order of the call."""
        given: dict[str, Value] = {}
        names = [name for name, _ in parameters]
        types = dict(parameters)
        if len(node.args) == 1 and isinstance(node.args[0], ast.Starred) and not node.keywords:
            return self._spread(node, node.args[0].value, parameters)
        if len(node.args) > len(names) or any(keyword.arg is None for keyword in node.keywords):
            raise self.function.refusal(node, "arguments", f"arguments of {ast.unparse(node.func)}")
        pairs = [*zip(names, node.args, strict=False), *((str(k.arg), k.value) for k in node.keywords)]
        for name, argument in pairs:
            if name in given or name not in types:
                raise self.function.refusal(node, "arguments", f"argument {name}")
            given[name] = self.converted(argument, self.expressions.value(argument), types[name])
        for name in names:
            if name not in given:
                given[name] = self._default(node, name, defaults.get(name))
        return [given[name] for name in names]

    def _default(self, node: ast.Call, name: str, known: tuple[Function, ast.expr | None] | None) -> Value:
        owner, default = known or (None, None)
        if default is not None and _is_literal(default):
            return self.expressions.literal(node, ast.literal_eval(default))
        if owner is not None and isinstance(default, ast.Name):
            return self.expressions.literal(node, owner.names.get(default.id))
        raise self.function.refusal(
            node, "arguments", f"argument {name} of {ast.unparse(node.func)} is missing"
        )

    def _spread(self, node: ast.Call, inner: ast.expr, parameters: Sequence[tuple[str, Type]]) -> list[Value]:
        """Return the arguments of ``f(*g(x))``, where g returns as many values as f takes."""
        target = self.expressions.constant(inner.func) if isinstance(inner, ast.Call) else None
        if not isinstance(inner, ast.Call) or python_function(target) is None or is_record(target):
            raise self.function.refusal(node, "starred expression")
        callee = self.callee(inner, target)
        if callee.result != Several(tuple(kind for _, kind in parameters)):
            raise self.function.refusal(node, "starred expression")
        assert isinstance(callee.result, Several)
        arguments = self.arguments(inner, callee)
        values = [self.writer.declare_temporary(name, kind) for name, kind in parameters]
        outputs = [f"&{value.text}" for value in values]
        self.writer.line(f"{callee.c_name}({', '.join([*arguments, *outputs])});")
        return values

    def converted(self, node: ast.AST, value: Value, kind: Type) -> Value:
        """Return ``value`` as a parameter, field or result of type ``kind``; only exact types are accepted."""
        if kind is REAL and value.type in (INT, WHOLE):
            raise self.function.refusal(node, "integer for a float")
        if isinstance(kind, Array) and isinstance(value.type, Array):
            is_known = ("",) not in (kind.shape, value.type.shape)
            if kind.item is not value.type.item or (is_known and kind.shape != value.type.shape):
                raise self.function.refusal(node, "values of different types", "array of another shape")
            return value
        if value.type != kind:
            raise self.function.refusal(node, "values of different types", "value of another type")
        return value

    # ------------------------------------------------------------------ Python's own functions

    def _built_in(self, node: ast.Call, target: Any) -> Value:
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.function.refusal(node, "arguments", f"arguments of {ast.unparse(node.func)}")
        if target in _MIN_MAX and len(node.args) > 1:
            return self._least_or_most(node, _MIN_MAX[target])
        if target in _MATH and len(node.args) == _MATH[target][1]:
            values = [as_real(self.expressions.number(argument)).text for argument in node.args]
            kind = WHOLE if target is math.floor else REAL
            return Value(kind, f"{_MATH[target][0]}({', '.join(values)})")
        if target in _TESTS and len(node.args) == 1:
            return Value(BOOL, f"{_TESTS[target]}({as_real(self.expressions.number(node.args[0])).text})")
        if target is math.ldexp and len(node.args) == 2:
            number, power = self.expressions.number(node.args[0]), self.expressions.number(node.args[1])
            if power.type is INT:
                return Value(REAL, f"fs_ldexp({as_real(number).text}, {power.text})")
        if len(node.args) == 1 and target in (abs, float, int, bool, len):
            return self._converted_by(node, target, node.args[0])
        is_math = getattr(target, "__module__", "") == "math"
        raise self.function.refusal(
            node, "libm function" if is_math else "function call", f"call of {ast.unparse(node.func)}"
        )

    def _least_or_most(self, node: ast.Call, name: str) -> Value:
        values = [self.expressions.number(argument) for argument in node.args]
        if {value.type for value in values} != {REAL}:
            raise self.function.refusal(node, "values of different types", "min or max of integers")
        made = values[0].text
        for value in values[1:]:
            made = f"{name}({made}, {value.text})"
        return Value(REAL, made)

    def _converted_by(self, node: ast.Call, target: Any, argument: ast.expr) -> Value:  # noqa: PLR0911  # a table
        value = self.expressions.value(argument)
        if target is len and isinstance(value.type, Array):
            return self.expressions.size(node, value.type.shape[0])
        if target is abs and value.type in (REAL, WHOLE):
            return Value(value.type, f"fs_abs({value.text})")
        if target is float and value.type is BOOL:
            return Value(REAL, f"{value.within(CHOICE + 1)} ? FS_LIT(1.0) : FS_LIT(0.0)", CHOICE)
        if target is float and value.type in (REAL, INT, WHOLE):
            return real_literal(float(value.literal)) if value.literal is not None else as_real(value)
        if target is int and value.type is BOOL:
            return Value(INT, f"{value.within(CHOICE + 1)} ? 1 : 0", CHOICE)
        if target is int and value.type in (REAL, WHOLE):
            return Value(INT, f"fs_to_int({value.text})")
        if (target is int and value.type is INT) or (target is bool and value.type is BOOL):
            return value
        if target is abs and value.type is INT:
            held = value if value.is_simple else self.writer.hoist(value, "number")
            return Value(INT, f"{held.text} < 0 ? -{held.within(UNARY)} : {held.text}", CHOICE)
        raise self.function.refusal(node, "function call", f"call of {ast.unparse(node.func)}")


def _array_argument(kind: Type, value: Value, is_written: bool) -> str:
    """Return an argument; C converts no pointer to rows to one of constant rows by itself."""
    if is_written or not isinstance(kind, Array) or len(kind.shape) == 1:
        return value.text
    sizes = "".join(f"[{c_size(size)}]" for size in kind.shape[1:])
    return f"(const {c_type(kind)}(*){sizes}){value.within(UNARY)}"


def _is_literal(node: ast.expr | None) -> bool:
    """Return True for a number in the source, with or without a sign."""
    if isinstance(node, ast.UnaryOp):
        node = node.operand
    return isinstance(node, ast.Constant)


def c_prototype(function: Function, is_inline: bool = False) -> str:
    """Return the declaration of a function in C, without a semicolon."""
    parts = []
    for parameter in function.parameters:
        name, kind = identifier(parameter.name), parameter.type
        const = "" if parameter.name in function.written else "const "
        if isinstance(kind, Record | Single):
            parts.append(f"{const}{c_type(kind)} *{name}")
        elif isinstance(kind, Array):
            sizes = "".join(f"[{c_size(size)}]" for size in kind.shape)
            parts.append(f"{const}{c_type(kind)} {name}{sizes}")
        else:
            parts.append(f"{c_type(kind)} {name}")
        if parameter.name in function.sized:
            parts.append(f"int32_t {name}_size")
    if function.needs_rotors:
        parts.append("int32_t rotors")
    parts += [f"{c_type(kind)} *{name}" for name, kind in function.outputs]
    result = (
        "void"
        if isinstance(function.result, Several) or function.result is NOTHING
        else c_type(function.result)
    )
    prefix = "static inline " if is_inline else "static " if function.is_private else ""
    return f"{prefix}{result} {function.c_name}({', '.join(parts) or 'void'})"
