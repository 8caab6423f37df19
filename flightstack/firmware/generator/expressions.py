"""Translation of expressions."""

from __future__ import annotations

import ast
import math
from types import ModuleType
from typing import TYPE_CHECKING, Any

from flightstack.core.float32 import LARGEST_FLOAT32
from flightstack.firmware.generator.analysis import Bounds
from flightstack.firmware.generator.calls import Calls
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.records import Records
from flightstack.firmware.generator.subset import construct_of
from flightstack.firmware.generator.text import identifier
from flightstack.firmware.generator.types import (
    BOOL,
    INT,
    NOTHING,
    REAL,
    ROTORS,
    WHOLE,
    Array,
    Record,
    Single,
    Table,
    c_type,
    has_arrays,
)
from flightstack.firmware.generator.values import (
    AND,
    ATOM,
    CHOICE,
    EQUAL,
    OR,
    ORDER,
    PRODUCT,
    SUM,
    UNARY,
    Form,
    Value,
    as_real,
    as_whole,
    bool_literal,
    field_of,
    int_literal,
    real_literal,
)

if TYPE_CHECKING:
    from flightstack.firmware.generator.writer import Line, Writer

_ARITHMETIC = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT)}
_COMPARISONS = {
    ast.Lt: ("<", ORDER),
    ast.LtE: ("<=", ORDER),
    ast.Gt: (">", ORDER),
    ast.GtE: (">=", ORDER),
    ast.Eq: ("==", EQUAL),
    ast.NotEq: ("!=", EQUAL),
}
NUMBERS = {REAL, INT, WHOLE}
_LARGEST_INT = 2**31 - 1
MISSING = object()


class Expressions:
    """Translates the expressions of one function."""

    def __init__(self, function: Function, writer: Writer) -> None:
        self.function, self.writer = function, writer
        self.calls = Calls(function, writer, self)
        self.bounds = Bounds(function, writer, self)
        self.records = Records(function, self)

    def value(self, node: ast.expr) -> Value:
        """Return the C expression of ``node``; statements that it needs go to the writer."""
        translate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if translate is None:
            raise self.function.refusal(node, construct_of(node))
        made: Value = translate(node)
        return made

    def number(self, node: ast.expr) -> Value:
        """Return a float or integer expression."""
        value = self.value(node)
        if value.type is BOOL:
            raise self.function.refusal(node, "arithmetic with a bool")
        if isinstance(value.type, Array):
            raise self.function.refusal(node, "array value")
        if value.type not in NUMBERS:
            raise self.function.refusal(node, "values of different types")
        return value

    def truth(self, node: ast.expr) -> Value:
        """Return a bool expression."""
        value = self.value(node)
        if value.type is not BOOL:
            raise self.function.refusal(node, "truth of a number")
        return value

    def condition(self, node: ast.expr) -> Value:
        """Return the test of an ``if``; a call that is the whole test may write to arrays."""
        if (
            isinstance(node, ast.UnaryOp)
            and isinstance(node.op, ast.Not)
            and isinstance(node.operand, ast.Call)
        ):
            return Value(BOOL, f"!{self.condition(node.operand).within(UNARY)}", UNARY)
        if not isinstance(node, ast.Call):
            return self.truth(node)
        value = self.calls.call(node, alone=True)
        if value.type is not BOOL:
            raise self.function.refusal(node, "truth of a number")
        return value

    def constant(self, node: ast.expr) -> Any:
        """Return the Python value of a constant of the module or the source, or ``MISSING``."""
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name):
            return MISSING if self.writer.has(node.id) else self.function.names.get(node.id, MISSING)
        if isinstance(node, ast.Attribute):
            owner = self.constant(node.value)
            if isinstance(owner, ModuleType | type):
                return getattr(owner, node.attr, MISSING)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = self.constant(node.operand)
            return -value if isinstance(value, int | float) else MISSING
        return MISSING

    # ------------------------------------------------------------------ leaves

    def _constant(self, node: ast.Constant) -> Value:
        return self.literal(node, node.value)

    def literal(self, node: ast.expr, value: Any) -> Value:
        """Return a number as C writes it."""
        if isinstance(value, bool):
            return bool_literal(value)
        if isinstance(value, int):
            if abs(value) > _LARGEST_INT:
                raise self.function.refusal(node, "constant", f"integer {value} beyond 32 bits")
            return int_literal(value)
        if isinstance(value, float):
            if LARGEST_FLOAT32 < abs(value) < math.inf:
                raise self.function.refusal(node, "constant", f"float {value} beyond 32 bits")
            return real_literal(value)
        raise self.function.refusal(node, construct_of(node))

    def _name(self, node: ast.Name) -> Value:
        if self.writer.has(node.id):
            return self.writer.load(node)
        return self._global(node, identifier(node.id))

    def _global(self, node: ast.expr, name: str) -> Value:
        """Return a constant of a module or class."""
        value = self.constant(node)
        if value is math.pi:
            return Value(REAL, "FS_PI")
        if isinstance(value, float) and not math.isfinite(value):
            return real_literal(value)
        if isinstance(value, bool):
            return bool_literal(value)
        if isinstance(value, int | float):
            literal = self.literal(node, value)
            return Value(literal.type, self.writer.unit.constant(name, literal.text), is_constant=True)
        shape = array_shape(value)
        if shape is not None:
            return Value(Array(shape), self.writer.unit.table(name, value, shape))
        raise self.function.refusal(node, "name", f"name {ast.unparse(node)}")

    def _attribute(self, node: ast.Attribute) -> Value:
        if self.constant(node.value) is not MISSING:
            return self._global(node, identifier(node.attr))
        owner = self.value(node.value)
        if isinstance(owner.type, Array) and node.attr == "size" and len(owner.type.shape) == 1:
            return self.writer.size_of(owner) or self.size(node, owner.type.shape[0])
        is_tuple = isinstance(owner.type, Record) and not owner.type.is_numpy
        if not is_tuple or node.attr not in owner.type.fields:  # type: ignore[union-attr]
            raise self.function.refusal(node, "attribute", f"attribute .{node.attr}")
        return self.field(owner, node.attr)

    def field(self, owner: Value, name: str) -> Value:
        """Return a field of a record."""
        assert isinstance(owner.type, Record)
        fields = owner.type.fields
        if owner.form is Form.FIELDS:
            return owner.fields[list(fields).index(name)]
        if owner.form is Form.MADE:
            owner = self.writer.hoist(owner)
        return field_of(owner, identifier(name), fields[name])

    def size(self, node: ast.AST, size: int | str) -> Value:
        """Return a dimension of an array."""
        if size == ROTORS:
            return Value(INT, self.writer.rotors())
        if not isinstance(size, int):
            raise self.function.refusal(node, "array of unknown shape")
        return int_literal(size)

    def _subscript(self, node: ast.Subscript) -> Value:
        shape = node.value
        if isinstance(shape, ast.Attribute) and shape.attr == "shape":
            array, axis = self.value(shape.value), self.constant(node.slice)
            if isinstance(array.type, Array) and axis in range(len(array.type.shape)):
                return self.size(node, array.type.shape[axis])
        array = self.value(shape)
        if isinstance(array.type, Record | Single | Table):
            return self.records.item(node, array)
        if not isinstance(array.type, Array):
            raise self.function.refusal(node, "index", "index of a number")
        return self._item(node, array, array.type)

    def _item(self, node: ast.Subscript, array: Value, kind: Array) -> Value:
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        text, left = array.text, list(kind.shape)
        for index in indices:
            if isinstance(index, ast.Slice):
                raise self.function.refusal(node, "slice")
            place = self.value(index)
            if place.type is not INT or not left:
                raise self.function.refusal(node, "index")
            if isinstance(place.literal, int) and place.literal < 0:
                raise self.function.refusal(node, "index", "negative index")
            text, _ = f"{text}[{place.text}]", left.pop(0)
        return Value(Array(tuple(left), kind.item) if left else kind.item, text, root=array.root)

    # ------------------------------------------------------------------ operators

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(BOOL, f"!{self.truth(node.operand).within(UNARY)}", UNARY)
        if not isinstance(node.op, ast.USub | ast.UAdd):
            raise self.function.refusal(node, construct_of(node.op))
        operand = self.number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return operand
        if operand.literal is not None and operand.text[0] != "-" and operand.text.startswith("FS_LIT"):
            return real_literal(-float(operand.literal))
        if operand.type is INT and isinstance(operand.literal, int):
            return int_literal(-operand.literal)
        if operand.type is WHOLE:
            return Value(WHOLE, f"FS_LIT(0.0) - {operand.within(PRODUCT)}", SUM)
        text = operand.within(UNARY)
        return Value(operand.type, f"-({text})" if text[0] == "-" else f"-{text}", UNARY)

    def _binop(self, node: ast.BinOp) -> Value:
        known = _ARITHMETIC.get(type(node.op))
        if known is None:
            raise self.function.refusal(node, construct_of(node.op))
        return self.combined(known, self.number(node.left), self.number(node.right))

    @staticmethod
    def combined(operator: tuple[str, int], left: Value, right: Value) -> Value:
        """Return an arithmetic operation; mixed operands, and those of a division, are floats."""
        sign, rank = operator
        if sign == "/" or REAL in (left.type, right.type):
            left, right = as_real(left), as_real(right)
        elif WHOLE in (left.type, right.type):
            left, right = as_whole(left), as_whole(right)
        text = f"{left.within(rank)} {sign} {right.within(rank + 1)}"
        if left.type is WHOLE and sign == "*":  # an integer has no negative zero
            return Value(WHOLE, f"{text} + FS_LIT(0.0)", SUM)
        is_constant = all(value.is_constant or value.literal is not None for value in (left, right))
        return Value(left.type, text, rank, is_constant=is_constant)

    def _boolop(self, node: ast.BoolOp) -> Value:
        is_and = isinstance(node.op, ast.And)
        made = self.truth(node.values[0])
        for operand in node.values[1:]:
            with self.writer.aside() as lines:
                right = self.truth(operand)
            if lines:  # evaluated only if the left operand does not decide
                decided: tuple[list[Line], Value] = ([], bool_literal(not is_and))
                ways = ((lines, right), decided) if is_and else (decided, (lines, right))
                made = self.writer.choice(made, *ways)
            else:
                sign, rank = ("&&", AND) if is_and else ("||", OR)
                made = Value(BOOL, f"{_logical(made, rank)} {sign} {_logical(right, rank)}", rank)
        return made

    def _compare(self, node: ast.Compare) -> Value:
        operands = [self.value(operand) for operand in (node.left, *node.comparators)]
        if len(operands) > 2:
            operands[1:-1] = [
                value if value.is_simple else self.writer.hoist(value, "between") for value in operands[1:-1]
            ]
        parts = []
        for left, right, operator in zip(operands, operands[1:], node.ops, strict=False):
            known = _COMPARISONS.get(type(operator))
            if known is None:
                raise self.function.refusal(node, construct_of(operator))
            parts.append(self._comparison(node, known, left, right))
        return parts[0] if len(parts) == 1 else Value(BOOL, " && ".join(part.text for part in parts), AND)

    def _comparison(self, node: ast.AST, known: tuple[str, int], left: Value, right: Value) -> Value:
        sign, rank = known
        kinds = {left.type, right.type}
        if len(kinds) > 1 and kinds <= NUMBERS:
            left, right = as_real(left), as_real(right)
        elif len(kinds) > 1 or not kinds <= NUMBERS | {BOOL} or (BOOL in kinds and rank == ORDER):
            raise self.function.refusal(node, "values of different types", "comparison of different types")
        return Value(BOOL, f"{left.within(ORDER + 1)} {sign} {right.within(ORDER + 1)}", rank)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.truth(node.test)
        with self.writer.aside() as yes_lines:
            yes = self.value(node.body)
        with self.writer.aside() as no_lines:
            no = self.value(node.orelse)
        if yes.type != no.type and {yes.type, no.type} <= NUMBERS:
            change = as_real if REAL in (yes.type, no.type) else as_whole
            yes, no = change(yes), change(no)
        if has_arrays(yes.type) or isinstance(yes.type, Array):
            raise self.function.refusal(node, "array value", "choice between arrays")
        if yes.type != no.type or yes.type is NOTHING:
            raise self.function.refusal(node, "values of different types")
        if isinstance(yes.type, Record) or yes_lines or no_lines:
            return self.writer.choice(test, (yes_lines, yes), (no_lines, no))
        text = f"{test.within(CHOICE + 1)} ? {yes.within(CHOICE + 1)} : {no.within(CHOICE + 1)}"
        return Value(yes.type, text, CHOICE)

    def _call(self, node: ast.Call) -> Value:
        return self.calls.call(node)

    def constructor(self, node: ast.Call, kind: type) -> Value:
        """Return a NamedTuple by its fields."""
        record = Record(kind)
        try:
            fields = record.fields
        except TypeError as error:
            raise self.function.refusal(node, "annotation", str(error)) from None
        row = self.records.row(node)
        if row is not None:
            return self.calls.converted(node, row, record)
        values = self.calls.bound(node, list(fields.items()), {})
        if has_arrays(record):
            return self.records.part(node, record, values)
        return Value(record, c_type(record), ATOM, Form.FIELDS, tuple(values))


def _logical(value: Value, rank: int) -> str:
    """Return an operand of && or ||, with brackets where both meet."""
    return f"({value.text})" if value.rank in (AND, OR, CHOICE) and value.rank != rank else value.text


def array_shape(value: Any) -> tuple[int, ...] | None:
    """Return the shape of a constant array or nested tuple of floats, or None."""
    if hasattr(value, "shape") and hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple) and value and not hasattr(value, "_fields"):
        if all(isinstance(item, float) for item in value):
            return (len(value),)
        inner = {array_shape(item) for item in value}
        if len(inner) == 1 and None not in inner:
            (shape,) = inner
            assert shape is not None
            return (len(value), *shape)
    return None
