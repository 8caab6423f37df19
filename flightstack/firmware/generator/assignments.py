"""Translation of assignments."""

from __future__ import annotations

import ast
import math
from typing import Any

import numpy as np

from flightstack.core.array_items import local_zeros
from flightstack.firmware.generator.expressions import Expressions
from flightstack.firmware.generator.law import Function, python_function
from flightstack.firmware.generator.subset import construct_of
from flightstack.firmware.generator.text import identifier
from flightstack.firmware.generator.types import (
    INT,
    NOTHING,
    REAL,
    WHOLE,
    Array,
    Record,
    Several,
    Table,
    c_type,
    has_arrays,
    is_numpy,
    is_record,
)
from flightstack.firmware.generator.values import PRODUCT, SUM, Form, Value, as_real
from flightstack.firmware.generator.writer import Variable, Writer, declaration

_AUGMENTED = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT)}
_NEW_ARRAYS = (np.zeros, np.empty, local_zeros)


class Assignments:
    """Translates the assignments of one function."""

    def __init__(self, function: Function, writer: Writer, expressions: Expressions) -> None:
        self.function, self.writer, self.expressions = function, writer, expressions

    def annotated(self, node: ast.AnnAssign) -> bool:
        """Translate an assignment with an annotation."""
        if node.value is not None:
            self._assign_to(node.target, node.value)
        return False

    def assign(self, node: ast.Assign) -> bool:
        """Translate an assignment."""
        if len(node.targets) == 1:
            self._assign_to(node.targets[0], node.value)
            return False
        value = self.expressions.value(node.value)
        held = value if value.is_simple else self.writer.hoist(value, "value")
        for target in node.targets:
            self._put(target, held)
        return False

    def _assign_to(self, target: ast.expr, source: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            self._unpack(target, source)
            return
        if isinstance(source, ast.Call):
            function = self.expressions.constant(source.func)
            if function in _NEW_ARRAYS:
                self._local_array(target, source, function)
                return
            self._put(target, self.expressions.calls.call(source, alone=True))
            return
        self._put(target, self.expressions.value(source))

    def _local_array(self, target: ast.expr, source: ast.Call, function: Any) -> None:
        shape_node = source.args[0] if len(source.args) == 1 and not source.keywords else source
        sizes = shape_node.elts if isinstance(shape_node, ast.Tuple) else [shape_node]
        if function is local_zeros:
            sizes = source.args
        shape = tuple(self.expressions.constant(size) for size in sizes)
        if not isinstance(target, ast.Name) or not all(type(size) is int and size > 0 for size in shape):
            raise self.function.refusal(source, "array of unknown shape")
        variable, is_new = self.writer.declare(target, target.id, Array(shape))
        if not is_new or not variable.is_stable:
            raise self.function.refusal(target, "array value", f"array {target.id} assigned twice")
        self.writer.array(variable.name, Array(shape), function is not np.empty)

    def _unpack(self, target: ast.Tuple, source: ast.expr) -> None:
        if isinstance(source, ast.Tuple):
            self._pairwise(target, source)
            return
        constant = self.expressions.constant(source.func) if isinstance(source, ast.Call) else None
        if isinstance(source, ast.Call) and python_function(constant) is not None and not is_record(constant):
            callee = self.expressions.calls.callee(source, constant)
            if isinstance(callee.result, Several):
                self.call_into(target, source, callee)
                return
        if (
            isinstance(source, ast.Call)
            and constant is math.frexp
            and len(source.args) == 1
            and len(target.elts) == 2
        ):
            number = self.expressions.number(source.args[0]).text
            held = [self.writer.declare_temporary(*part) for part in (("mantissa", REAL), ("power", INT))]
            self.writer.line(f"fs_frexp({number}, &{held[0].text}, &{held[1].text});")
            for element, part in zip(target.elts, held, strict=True):
                self._put(element, part)
            return
        value = self.expressions.value(source)
        if (
            not isinstance(value.type, Record)
            or is_numpy(value.type)
            or len(value.type.fields) != len(target.elts)
        ):
            raise self.function.refusal(source, "tuple", "unpacking of a value that is no tuple")
        fields = list(value.type.fields)
        if value.form is Form.MADE:
            value = self.writer.hoist(value)
        for element, name in zip(target.elts, fields, strict=True):
            self._put(element, self.expressions.field(value, name))

    def _pairwise(self, target: ast.Tuple, source: ast.Tuple) -> None:
        """Assign a tuple of expressions, through temporaries if one reads what an earlier one writes."""
        if len(target.elts) != len(source.elts) or any(isinstance(e, ast.Starred) for e in source.elts):
            raise self.function.refusal(source, "tuple", "tuples of different lengths")
        written = [{n.id for n in ast.walk(element) if isinstance(n, ast.Name)} for element in target.elts]
        read = [{n.id for n in ast.walk(element) if isinstance(n, ast.Name)} for element in source.elts]
        meets = any(written[i] & read[j] for j in range(len(read)) for i in range(j))
        meets = meets and (
            any(isinstance(element, ast.Subscript) for element in source.elts)
            or not any(isinstance(element, ast.Subscript) for element in target.elts)
        )
        if not meets or any(isinstance(element, ast.Tuple) for element in target.elts):
            for element, value in zip(target.elts, source.elts, strict=True):
                self._assign_to(element, value)
            return
        values = [self.writer.hoist(self._flat(element), "value") for element in source.elts]
        for element, held in zip(target.elts, values, strict=True):
            self._put(element, held)

    def _flat(self, node: ast.expr) -> Value:
        value = self.expressions.value(node)
        if isinstance(value.type, Array):
            raise self.function.refusal(node, "array value")
        return value

    def call_into(self, target: ast.Tuple, source: ast.Call, callee: Function) -> None:
        """Call a function with several results, with the targets for its out-parameters."""
        assert isinstance(callee.result, Several)
        if len(callee.result.items) != len(target.elts):
            raise self.function.refusal(source, "tuple", "tuples of different lengths")
        arguments, outputs, later = self.expressions.calls.arguments(source, callee), [], []
        for element, kind in zip(target.elts, callee.result.items, strict=True):
            name = element.id if isinstance(element, ast.Name) else ""
            old = self.writer.variables.get(name)
            is_read = old is not None and any(f"&{old.name}" in argument for argument in arguments)
            if not name.strip("_") or is_read:
                held = self.writer.declare_temporary(name.strip("_") or "unused", kind)
                outputs.append(f"&{held.text}")
                later += [] if name and not name.strip("_") else [(element, held)]
                continue
            variable, is_new = self.writer.declare(element, name, kind)
            variable.is_stable = variable.is_stable and is_new
            if is_new:
                self.writer.line(declaration(variable))
            outputs.append(f"&{variable.name}")
        self.writer.line(f"{callee.c_name}({', '.join([*arguments, *outputs])});")
        for element, held in later:
            self._put(element, held)

    def _put(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a name or to an item of an array."""
        if isinstance(target, ast.Subscript):
            place = self.expressions.value(target)
            if place.type not in (REAL, INT):
                raise self.function.refusal(target, "array value")
            self.writer.write_to(target, place)
            if place.type is REAL and value.type in (INT, WHOLE):
                value = as_real(value)
            if value.type is not place.type:
                raise self.function.refusal(target, "values of different types")
            self.writer.store(f"{place.text} = ", value)
            return
        if not isinstance(target, ast.Name):
            raise self.function.refusal(target, "assignment to an attribute")
        if value.type is NOTHING or isinstance(value.type, Several):
            raise self.function.refusal(target, "values of different types", "assignment of no value")
        if isinstance(value.type, Array | Table):
            self._alias_array(target, value)
            return
        variable, is_new = self.writer.declare(target, target.id, value.type)
        self._store(target, variable, is_new, value)

    def _store(self, node: ast.AST, variable: Variable, is_new: bool, value: Value) -> None:
        writer, kind = self.writer, c_type(variable.type)
        is_part = value.form in (Form.VALUE, Form.POINTER) and isinstance(value.type, Record)
        if is_new and is_part and variable.is_stable and writer.is_stable(value.root):
            variable.form, variable.root = Form.POINTER, value.root
            pointer = value.text if value.form is Form.POINTER else f"&{value.text}"
            if has_arrays(value.type):
                writer.pointer(f"{kind} *{variable.name}", pointer, value.root)
            else:
                writer.line(f"const {kind} *{variable.name} = {pointer};")
            return
        if has_arrays(value.type):
            kind_of = "record" if is_numpy(value.type) else "NamedTuple with arrays"
            raise self.function.refusal(node, "array value", f"copy of a {kind_of}")
        head = f"{'const ' if variable.is_stable else ''}{kind} " if is_new else ""
        writer.store(f"{head}{variable.name} = ", value)

    def _alias_array(self, target: ast.Name, value: Value) -> None:
        """Give an array, or a row of one, a second name."""
        if len(self.writer.usage.stores[target.id]) > 1 or target.id in self.writer.variables:
            raise self.function.refusal(target, "array value", f"array {target.id} assigned twice")
        text = value.text
        if text.endswith("]"):  # a row: its index may change
            if not isinstance(value.type, Array) or len(value.type.shape) > 1:
                raise self.function.refusal(target, "array value", f"part {target.id} of an array")
            self.writer.pointer(f"{c_type(value.type)} *{identifier(target.id)}", text, value.root)
            text = identifier(target.id)
        self.writer.variables[target.id] = Variable(text, value.type, root=value.root, is_stable=True)
        self.writer.assigned.add(target.id)

    def augmented(self, node: ast.AugAssign) -> bool:
        """Translate an operation in place."""
        known = _AUGMENTED.get(type(node.op))
        if known is None:
            raise self.function.refusal(node, construct_of(node.op))
        target, value = node.target, self.expressions.number(node.value)
        reading = ast.Name(target.id, ast.Load()) if isinstance(target, ast.Name) else target
        old = self.expressions.number(ast.copy_location(reading, target))
        made = self.expressions.combined(known, old, value)
        if isinstance(target, ast.Name):
            variable, is_new = self.writer.declare(target, target.id, made.type)
            if is_new:
                self._store(target, variable, is_new, made)
                return False
        else:
            self.writer.write_to(target, old)
            if made.type is not old.type:
                raise self.function.refusal(target, "values of different types")
        place = variable.name if isinstance(target, ast.Name) else old.text
        number = value if made.type is INT else as_real(value)
        is_product = made.type is WHOLE and known[0] == "*"  # which has a sum behind it
        self.writer.line(f"{place} = {made.text};" if is_product else f"{place} {known[0]}= {number.text};")
        return False
