"""Lines of a C function: variables, temporaries and layout."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flightstack.firmware.generator.analysis import Path, Usage
from flightstack.firmware.generator.law import Function
from flightstack.firmware.generator.text import WIDTH, comment, fold, identifier
from flightstack.firmware.generator.types import (
    INT,
    Array,
    Record,
    Scalar,
    Single,
    Type,
    c_size,
    c_type,
    has_rotors,
)
from flightstack.firmware.generator.values import Form, Value

if TYPE_CHECKING:
    from flightstack.firmware.generator.unit import Unit

Line = tuple[int, str]
"""Depth of indentation and text."""
_ONE_LINE = 90
_CONST, _END = "\x01", "\x02"
_MARK = re.compile(f"{_CONST}(.*?){_END}")
"""Mark of a pointer that is const unless the function writes to the variable named between both signs."""


@dataclass
class Variable:
    """A variable of the function in C."""

    name: str
    type: Type
    form: Form = Form.VALUE
    root: str = ""
    """Parameter or variable that a pointer points into; else the variable itself."""
    is_stable: bool = False
    """True if its value never changes, so that pointers into it stay valid."""


class Writer:
    """Collects the lines of one function, and declares its variables."""

    def __init__(self, function: Function, unit: Unit) -> None:
        self.function, self.unit = function, unit
        self.usage = Usage(function.node)
        self.lines: list[Line] = []
        self.depth = 1
        self.path: Path = ()
        self.variables: dict[str, Variable] = {}
        self.assigned: set[str] = set()
        self.loops: list[str] = []
        """Variables of the loops around the statement in progress."""
        self.pending: dict[Path, list[Variable]] = {}
        """Variables to declare before the compound statement in progress, by block."""
        names = {parameter.name for parameter in function.parameters}
        self._local = names | set(self.usage.stores) | self.usage.loop_variables
        self._taken = {self._c_local(name) for name in self._local} | {name for name, _ in function.outputs}
        for parameter in function.parameters:
            form = Form.POINTER if isinstance(parameter.type, Record | Single) else Form.VALUE
            self.variables[parameter.name] = Variable(
                identifier(parameter.name), parameter.type, form, parameter.name, is_stable=True
            )
            self.assigned.add(parameter.name)

    # ------------------------------------------------------------------ variables

    def has(self, name: str) -> bool:
        """Return True for a parameter or variable of the function."""
        return name in self._local

    def load(self, node: ast.Name) -> Value:
        """Return a variable's value."""
        variable = self.variables.get(node.id)
        if variable is None or node.id not in self.assigned:
            raise self.function.refusal(node, "variable without a value", f"variable {node.id}")
        return Value(variable.type, variable.name, form=variable.form, root=variable.root)

    def is_whole_parameter(self, name: str) -> bool:
        """Return True for an integer parameter that the function does not assign."""
        variable = self.variables.get(name)
        return (
            name in self._parameters()
            and variable is not None
            and variable.type is INT
            and not self.usage.stores.get(name)
        )

    def is_stable(self, root: str) -> bool:
        """Return True if pointers into a variable stay valid."""
        variable = self.variables.get(root)
        return (
            variable is not None
            and variable.is_stable
            and not (variable.root in self._parameters() and self.usage.stores.get(variable.root))
        )

    def _parameters(self) -> set[str]:
        return {parameter.name for parameter in self.function.parameters}

    def declare(self, node: ast.AST, name: str, kind: Type) -> tuple[Variable, bool]:
        """Return the variable that an assignment writes, and whether the assignment declares it."""
        variable = self.variables.get(name)
        is_parameter = (
            variable is not None and name in self._parameters() and variable.name == identifier(name)
        )
        if variable is not None and not is_parameter:
            if variable.type != kind:
                raise self.function.refusal(node, "type of a variable", f"variable {name}")
            self.assigned.add(name)
            return variable, False
        if is_parameter and variable is not None and variable.type != kind:
            raise self.function.refusal(node, "type of a variable", f"parameter {name}")
        if name in self.usage.loop_variables:
            raise self.function.refusal(node, "loop variable", f"assignment to {name}")
        c_name = self.fresh(f"new_{identifier(name)}") if is_parameter else self._c_local(name)
        made = Variable(c_name, kind, root=name)
        self.variables[name] = made
        self.assigned.add(name)
        home = () if is_parameter else self.usage.home(name)
        if home == self.path:
            made.is_stable = len(self.usage.stores[name]) == 1
            return made, True
        self.pending.setdefault(home, []).append(made)
        return made, False

    def copy_parameter(self, name: str) -> None:
        """Replace a parameter, assigned within a compound statement, by a variable with its value."""
        old = self.variables[name]
        made = Variable(self.fresh(f"new_{old.name}"), old.type, root=name)
        star = "*" if old.form is Form.POINTER else ""
        self.line(f"{c_type(old.type)} {made.name} = {star}{old.name};")
        self.variables[name] = made

    def _c_local(self, name: str) -> str:
        c_name = identifier(name)
        return f"{c_name}_" if c_name in self.unit.static_names or c_name == "rotors" else c_name

    def fresh(self, hint: str) -> str:
        """Return a name that no variable of the function has."""
        name, count = self._c_local(hint), 1
        while name in self._taken:
            count += 1
            name = f"{hint}_{count}"
        self._taken.add(name)
        return name

    def rotors(self) -> str:
        """Return the number of rotors: a field of a parameter, or a parameter of its own."""
        for parameter in self.function.parameters:
            if has_rotors(parameter.type):
                return f"{identifier(parameter.name)}->rotors"
        self.function.needs_rotors = True
        return "rotors"

    def size_of(self, array: Value) -> Value | None:
        """Return the size of a parameter that is an array of any size, a parameter of its own; else None."""
        is_parameter = array.root in self._parameters() and array.text == identifier(array.root)
        if not is_parameter or array.type != Array(("",)):
            return None
        self.function.sized.add(array.root)
        return Value(INT, f"{array.text}_size")

    def write_to(self, node: ast.AST, value: Value) -> None:
        """Note that the function writes to an array: a variable, a parameter, or a field of a parameter."""
        variable, is_parameter = self.variables.get(value.root), value.root in self._parameters()
        if variable is None or not (isinstance(variable.type, Array) or is_parameter):
            raise self.function.refusal(node, "assignment to an attribute", "write to a constant array")
        if is_parameter:
            self.function.written.add(value.root)

    def pointer(self, target: str, value: str, root: str) -> None:
        """Declare a pointer into ``root``; it is const if ``root`` is a parameter that the function does not write."""
        self.line(f"{_CONST}{root}{_END}{target} = {value};")

    # ------------------------------------------------------------------ temporaries

    def hoist(self, value: Value, hint: str = "") -> Value:
        """Return a constant with a value that has no address, or must be evaluated once."""
        name = self.fresh(identifier(value.callee or hint or "value"))
        self.store(f"const {c_type(value.type)} {name} = ", value)
        return Value(value.type, name, root=name)

    def declare_temporary(self, hint: str, kind: Type) -> Value:
        """Return a new variable without a value."""
        name = self.fresh(identifier(hint))
        self.line(f"{c_type(kind)} {name};")
        return Value(kind, name, root=name)

    @contextmanager
    def aside(self) -> Iterator[list[Line]]:
        """Collect the lines of the block in a list of their own."""
        outer, self.lines = self.lines, []
        try:
            yield self.lines
        finally:
            self.lines = outer

    def choice(self, test: Value, yes: tuple[list[Line], Value], no: tuple[list[Line], Value]) -> Value:
        """Return a variable that has one of two values, each with the lines that it needs."""
        made = self.declare_temporary("chosen", yes[1].type)
        self.line(f"if ({test.text}) {{")
        for lines, value in (yes, no):
            self.lines += [(depth + 1, text) for depth, text in lines]
            self.depth += 1
            self.store(f"{made.text} = ", value)
            self.depth -= 1
            self.line("} else {" if value is yes[1] else "}")
        return made

    # ------------------------------------------------------------------ lines

    def line(self, text: str) -> None:
        """Add a line."""
        self.lines.append((self.depth, text))

    def store(self, target: str, value: Value) -> None:
        """Add an assignment or a declaration with a value; ``target`` ends with the equals sign."""
        if value.form is not Form.FIELDS:
            self.line(f"{target}{value.item()};")
            return
        is_declaration = " " in target.removesuffix(" = ")
        literal = "" if is_declaration and not target.startswith("return") else f"({c_type(value.type)})"
        self._fields(f"{target}{literal}", value, ";")

    def _fields(self, head: str, value: Value, tail: str) -> None:
        """Add a structure's values, on a line if short, else by their names."""
        flat = head + value.item() + tail
        is_nested = any(field.form is Form.FIELDS for field in value.fields)
        if len(flat) <= _ONE_LINE and not is_nested:
            self.line(flat)
            return
        assert isinstance(value.type, Record)
        self.line(head + "{")
        self.depth += 1
        for name, field in zip(value.type.fields, value.fields, strict=True):
            if field.form is Form.FIELDS:
                self._fields(f".{identifier(name)} = ", field, ",")
            else:
                self.line(f".{identifier(name)} = {field.item()},")
        self.depth -= 1
        self.line("}" + tail)

    def array(self, name: str, kind: Array, is_zero: bool) -> None:
        """Add the declaration of a local array."""
        sizes = "".join(f"[{c_size(size)}]" for size in kind.shape)
        self.line(f"fs_real {name}{sizes}{' = {0}' if is_zero else ''};")

    def remark(self, text: str, since: int) -> None:
        """Add a comment of the source to the line written since then, or above the lines."""
        written = comment(text)
        if len(self.lines) == since + 1 and len(written) == 1:
            depth, last = self.lines[since]
            if 4 * depth + len(last) + len(written[0]) + 1 <= WIDTH:
                self.lines[since] = (depth, f"{last} {written[0]}")
                return
        self.lines[since:since] = [(self.depth, line) for line in written]

    def text(self) -> list[str]:
        """Return the folded lines; a variable that is never read is marked, for compilers that warn."""
        self.lines = [(depth, self._qualified(line)) for depth, line in self.lines]
        for name in sorted(self._taken):
            self._mark_unused(name)
        whole = "\n".join(re.sub(r"/\*.*?\*/", "", text) for _, text in self.lines)
        parameters = [identifier(parameter.name) for parameter in self.function.parameters]
        unread = [name for name in parameters if not re.search(rf"(?<![.\w]){name}\b", whole)]
        self.lines[:0] = [(1, f"(void){name};") for name in unread]
        return [folded for depth, text in self.lines for folded in fold(text, "    " * depth)]

    def _qualified(self, line: str) -> str:
        """Return a line with ``const`` in place of its mark, if that is so; known when the whole function is."""
        unwritten = self._parameters() - self.function.written
        return _MARK.sub(lambda mark: "const " if mark[1] in unwritten else "", line)

    def _mark_unused(self, name: str) -> None:
        declared = re.compile(rf"(?!return )(const )?\w+ \*?{name}(?P<value> = .*)?;?$")
        places = [at for at, (_, line) in enumerate(self.lines) if declared.match(line.partition(" /*")[0])]
        uses = sum(len(re.findall(rf"\b(?<!\.){name}\b", line)) for _, line in self.lines)
        writes = re.compile(rf"{name} [-+*/]?= ")
        if len(places) != 1 or uses > 1 + sum(bool(writes.match(line)) for _, line in self.lines):
            return
        at, depth = places[0], self.lines[places[0]][0]
        while not self.lines[at][1].partition(" /*")[0].endswith(";") or self.lines[at][0] != depth:
            at += 1
        self.lines.insert(at + 1, (depth, f"(void){name};"))


def declaration(variable: Variable) -> str:
    """Return the declaration of a variable without a value."""
    assert isinstance(variable.type, Scalar | Record)
    return f"{c_type(variable.type)} {variable.name};"
