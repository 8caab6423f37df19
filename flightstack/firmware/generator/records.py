"""NumPy records: structures in C, whose fields and parts compiled functions take by name.

A module of its own: scalar expressions and calls both use it.
"""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import TYPE_CHECKING

from flightstack.core.array_items import as_tuple
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.types import INT, Record, Single, Table
from flightstack.firmware.generator.values import Value

if TYPE_CHECKING:
    from flightstack.firmware.generator.expressions import Expressions


class Records:
    """Translates the access to records of one function."""

    def __init__(self, function: Function, expressions: Expressions) -> None:
        self.function, self.expressions = function, expressions

    def item(self, node: ast.Subscript, record: Value) -> Value:
        """Return a field of a NumPy record, or a record of an array."""
        if isinstance(record.type, Table):
            return self._element(node, record, record.type)
        key = self.expressions.constant(node.slice)
        if isinstance(record.type, Single):
            if key != 0 or not isinstance(key, int):
                raise self.function.refusal(node, "index of a record")
            return replace(record, type=record.type.record)
        assert isinstance(record.type, Record)
        if not isinstance(key, str) or not record.type.is_numpy:
            raise self.function.refusal(node, "index of a NamedTuple")
        part = record.type.part_with(key)
        if part is not None:
            return self.expressions.field(self.expressions.field(record, part), key)
        if key not in record.type.fields:
            raise self.function.refusal(node, "index of a record", f"field {key} of a record")
        return self.expressions.field(record, key)

    def _element(self, node: ast.Subscript, table: Value, kind: Table) -> Value:
        index = self.expressions.value(node.slice)
        is_negative = isinstance(index.literal, int) and index.literal < 0
        if index.type is not INT or is_negative:
            raise self.function.refusal(node, "index", "negative index" if is_negative else "")
        return Value(kind.record, f"{table.text}[{index.text}]", root=table.root)

    def row(self, node: ast.Call) -> Value | None:
        """Return the field of a record that ``Params(*as_tuple(record["params"], SIZE))`` reads; else None."""
        spread = node.args[0] if len(node.args) == 1 and not node.keywords else None
        inner = spread.value if isinstance(spread, ast.Starred) else None
        if (
            not isinstance(inner, ast.Call)
            or self.expressions.constant(inner.func) is not as_tuple
            or len(inner.args) != 2
        ):
            return None
        row, size = self.expressions.value(inner.args[0]), self.expressions.constant(inner.args[1])
        if row.owner is None or not isinstance(row.type, Record) or size != len(row.type.fields):
            raise self.function.refusal(node, "starred expression")
        return row

    def part(self, node: ast.Call, record: Record, values: list[Value]) -> Value:
        """Return the structure that all fields of a NamedTuple of arrays stand in."""
        owner = values[0].owner
        if owner is not None and owner.type == record:
            places = [self.expressions.field(owner, name).text for name in record.fields]
            if places == [value.text for value in values]:
                return owner
        raise self.function.refusal(node, "NamedTuple of arrays", "NamedTuple made of arrays")
