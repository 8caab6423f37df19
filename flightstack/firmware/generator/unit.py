"""C files made of Python modules."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flightstack.control.control_law import AttitudeInputs
from flightstack.core import portable_math
from flightstack.core.compiled import IS_DISABLED
from flightstack.firmware.generator.calls import c_prototype
from flightstack.firmware.generator.law import Function, load, python_function, static_name
from flightstack.firmware.generator.text import comment, fold, identifier, snake_case
from flightstack.firmware.generator.types import (
    Array,
    Record,
    Several,
    Single,
    Table,
    Type,
    c_size,
    c_type,
    has_rotors,
    prefix_of,
    record_name,
)

WRITTEN_BY_HAND = (portable_math.sin_cos, portable_math.arc_tangent_series)
"""Functions of firmware/core with polynomials for each precision."""
_LAW_MATH = re.compile(r"\bfs_(floor|copysign|is_nan|to_int|ldexp|frexp)\(|\bFS_(NAN|INFINITY)\b")
PROVIDED = {"flightstack.core.contract": "fs_types"}
"""Modules whose types are in firmware/core."""
PROVIDED_TYPES: Mapping[type, str] = {AttitudeInputs: "fs_types"}
"""Types in firmware/core of other modules."""
NOTICE = "Generated from Python by flightstack.firmware.generator: do not edit."


class Unit:
    """A C file and its header, made of one Python module."""

    def __init__(self, program: Program, module: str) -> None:
        self.program, self.module = program, module
        self.name = program.names.get(module) or unit_name(module)
        self.functions: list[Function] = []
        self.includes: set[str] = set()
        self.records: list[type] = []
        self._constants: dict[str, str] = {}
        self._tables: dict[str, list[str]] = {}
        self.static_names = frozenset(
            static_name(name, module)
            for name, value in vars(sys.modules[module]).items()
            if name.startswith("_") and python_function(value) is not None
        )

    def constant(self, name: str, text: str) -> str:
        """Return the macro of a constant."""
        is_inline = self.module in self.program.inline  # other units see its macros
        prefix = self.name if is_inline else prefix_of(self.module)
        made = f"{prefix}_{identifier(name).strip('_')}".upper()
        known = self._constants.setdefault(made, text)
        if known != text:  # two constants of one name, of different modules
            made = f"{made}_{len(self._constants)}"
            self._constants[made] = text
        return made

    def table(self, name: str, value: Any, shape: tuple[int, ...]) -> str:
        """Return the name of a constant array."""
        made = identifier(name).strip("_").lower()
        sizes = "".join(f"[{size}]" for size in shape)
        values = value.tolist() if hasattr(value, "tolist") else value
        self._tables[made] = fold(f"static const fs_real {made}{sizes} = {_braced(values)};")
        return made

    def require(self, caller: Function, node: ast.AST, target: Any) -> Function:
        """Return the translation of a function that ``caller`` calls."""
        callee = self.program.translated(target, caller, node)
        if callee.module != self.module or not self.program.writes(callee):
            if callee.is_private:
                raise caller.refusal(
                    node, "function call", f"private function {callee.name} of another module"
                )
            self.includes.add(f"{self.program.header_of(callee)}.h")
        return callee

    # ------------------------------------------------------------------ text

    def header(self) -> str:
        """Return the text of the header."""
        guard = f"{self.name}_h".upper()
        parts = [*self._head(), f"#ifndef {guard}", f"#define {guard}", ""]
        parts += [f'#include "{name}"' for name in sorted({"fs_types.h", *self._type_headers()})] + [""]
        for kind in self.records:
            parts += [*structure(kind), ""]
        for function in self.functions:
            if not function.is_private:
                parts += [*_description(function), *fold(c_prototype(function) + ";"), ""]
        return "\n".join([*parts, "#endif", ""])

    def inline(self) -> str:
        """Return the text of a header with the functions themselves, static inline."""
        guard = f"{self.name}_h".upper()
        parts = [
            *self._head(),
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            *self._include_lines({"fs_types.h"}),
        ]
        parts += self._definitions()
        for function in self.functions:
            parts += [
                *_description(function),
                *fold(c_prototype(function, True)),
                "{",
                *function.lines,
                "}",
                "",
            ]
        return "\n".join([*parts, "#endif", ""])

    def source(self) -> str:
        """Return the text of the C file."""
        parts = [*self._head(), f'#include "{self.name}.h"', "", *self._include_lines(set())]
        parts += self._definitions()
        for function in self.functions:
            description = _description(function) if function.is_private else comment(function.place)
            parts += [*description, *fold(c_prototype(function)), "{", *function.lines, "}", ""]
        return "\n".join(parts)

    def _head(self) -> list[str]:
        module = sys.modules[self.module]
        title = (module.__doc__ or "").strip().partition("\n")[0]
        where = self.module.replace(".", "/") + ".py"
        return [f"/* {NOTICE} */", *comment(f"{title} {where}".strip())]

    def _include_lines(self, more: set[str]) -> list[str]:
        names = {*self.includes, "fs_math.h", *more} - {f"{self.name}.h"}
        if any(_LAW_MATH.search(line) for function in self.functions for line in function.lines):
            names = {*names, "fs_law_math.h"}
        return [*(f'#include "{name}"' for name in sorted(names)), ""]

    def _definitions(self) -> list[str]:
        parts = [f"#define {name} {text}" for name, text in self._constants.items()]
        parts += [line for table in self._tables.values() for line in table]
        return [*parts, ""] if parts else []

    def _type_headers(self) -> set[str]:
        kinds = [kind for function in self.functions for kind in _types(function)]
        kinds += [part for kind in self.records for part in _parts(Record(kind))]
        homes = {self.program.home_of(kind) for kind in kinds}
        return {f"{home}.h" for home in homes if home and home != self.name}


class Program:
    """Modules translated together."""

    def __init__(
        self,
        provided: Mapping[str, str] = PROVIDED,
        types: Mapping[type, str] | None = None,
        accepts_plain: bool = False,
        below: Program | None = None,
        names: Mapping[str, str] | None = None,
        inline: Sequence[str] = (),
    ) -> None:
        """Translate without writing the modules of ``provided``, which are in C already: module → header.

        ``types`` has the headers of records that are declared elsewhere. ``accepts_plain`` accepts
        functions that are not marked @compiled. The functions of the program ``below`` are called, not written;
        ``names`` gives other names to the files of modules that both programs have. The modules of ``inline`` are
        headers with their functions.
        """
        self.provided = dict(provided)
        self.below, self.names, self.inline = below, dict(names or {}), frozenset(inline)
        self.accepts_plain = accepts_plain or IS_DISABLED  # then nothing is marked
        self.units: dict[str, Unit] = {}
        self.types: dict[type, str] = {**PROVIDED_TYPES, **(types or {})}
        """Header of each record that is not declared by its unit."""
        self._functions: dict[Callable[..., Any], Function] = {}
        self._open: list[Callable[..., Any]] = []
        self._public: dict[str, Callable[..., Any]] = {}

    def add(self, target: Any) -> Function:
        """Translate a function and all that it calls; raise OutsideSubsetError."""
        return self.translated(target, None, None)

    def translated(self, target: Any, caller: Function | None, node: ast.AST | None) -> Function:
        """Return a translated function."""
        from flightstack.firmware.generator.statements import translate

        python = python_function(target)
        assert python is not None
        known = self.known(python) or (self.below.known(python) if self.below is not None else None)
        if known is not None:
            return known
        if python in self._open and caller is not None and node is not None:
            raise caller.refusal(node, "recursion", f"recursion of {python.__name__}")
        function = load(target)
        unit = self.unit(function.module)
        if python not in WRITTEN_BY_HAND:
            self._open.append(python)
            translate(function, unit)
            self._open.pop()
            if not function.part:
                unit.functions.append(function)
            if not function.is_private and self._public.setdefault(function.c_name, python) is not python:
                detail = f"second function {function.name}"
                raise function.refusal(function.node, "two functions of one name", detail)
            for kind in _types(function):
                self._declare(kind, unit)
        self._functions[python] = function
        return function

    def known(self, python: Callable[..., Any]) -> Function | None:
        """Return the translation of a function, if it has one."""
        return self._functions.get(python)

    def writes(self, function: Function) -> bool:
        """Return True for a function that is written to a unit of this program."""
        return function.python in self._functions and function.python not in WRITTEN_BY_HAND

    def unit(self, module: str) -> Unit:
        """Return the unit of a module."""
        if module not in self.units:
            self.units[module] = Unit(self, module)
        return self.units[module]

    def header_of(self, function: Function) -> str:
        """Return the header that declares a function, without its ending."""
        if function.python in WRITTEN_BY_HAND:
            return "fs_math"
        if self.below is not None and self.below.known(function.python) is not None:
            return self.below.header_of(function)
        return self.provided.get(function.module, self.unit(function.module).name)

    def home_of(self, kind: type) -> str:
        """Return the header that declares a record."""
        if kind in self.types:
            return self.types[kind]
        return self.provided.get(kind.__module__, unit_name(kind.__module__))

    def _declare(self, kind: type, _: Unit) -> None:
        if kind in self.types:
            return
        home = self.unit(kind.__module__)
        if kind not in home.records:
            for inner in _parts(Record(kind)):
                if inner is not kind:
                    self._declare(inner, home)
            home.records.append(kind)

    def written(self) -> list[Unit]:
        """Return the units to write, those of provided modules left out."""
        return [
            unit
            for module, unit in self.units.items()
            if module not in self.provided and (unit.functions or unit.records)
        ]


def unit_name(module: str) -> str:
    """Return the name of the C file of a module."""
    parts = module.split(".")
    return f"fs_{snake_case(parts[-1])}" if parts[0] == "flightstack" else "_".join(map(snake_case, parts))


def structure(kind: type, name: str = "") -> list[str]:
    """Return the C structure of a NamedTuple: its fields in order, the first sentence of its docstring above."""
    record = Record(kind)
    lines = comment((kind.__doc__ or "").strip().partition("\n")[0])
    lines.append("typedef struct {")
    if has_rotors(record):
        lines.append("    int32_t rotors;")
    for field, inner in record.fields.items():
        shape = inner.shape if isinstance(inner, Array) else (inner.size,) if isinstance(inner, Table) else ()
        sizes = "".join(f"[{c_size(size)}]" for size in shape)
        lines.append(f"    {c_type(inner)} {identifier(field)}{sizes};")
    return [*lines, f"}} {name or record_name(kind)};"]


def _parts(kind: Type) -> list[type]:
    if isinstance(kind, Record):
        return [*(part for inner in kind.fields.values() for part in _parts(inner)), kind.kind]
    if isinstance(kind, Single | Table):
        return _parts(kind.record)
    if isinstance(kind, Several):
        return [part for inner in kind.items for part in _parts(inner)]
    return []


def _types(function: Function) -> list[type]:
    kinds = [*(parameter.type for parameter in function.parameters), function.result]
    return [part for kind in kinds for part in _parts(kind)]


def _description(function: Function) -> list[str]:
    """Return the comment above a function: its docstring and the place of its Python source."""
    text = ast.get_docstring(function.node) or ""
    return comment(f"{text}\n\n{function.place}" if "\n" in text else f"{text} {function.place}".strip())


def _braced(values: Sequence[Any]) -> str:
    inner = [f"FS_LIT({float(value)!r})" if isinstance(value, float) else _braced(value) for value in values]
    return "{" + ", ".join(inner) + "}"


def write(units: Sequence[Unit], folder: Path) -> list[Path]:
    """Write header and C file of each unit to ``folder``; return the C files."""
    folder.mkdir(parents=True, exist_ok=True)
    for unit in units:
        (folder / f"{unit.name}.h").write_text(unit.header(), encoding="ascii")
        (folder / f"{unit.name}.c").write_text(unit.source(), encoding="ascii")
    return [folder / f"{unit.name}.c" for unit in units]
