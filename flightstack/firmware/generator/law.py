"""Functions of the subset: source, names and signature."""

from __future__ import annotations

import ast
import functools
import inspect
import io
import re
import sys
import textwrap
import tokenize
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType
from typing import Any

from flightstack.firmware.generator.subset import ADVICE, OutsideSubsetError
from flightstack.firmware.generator.text import ascii_text, identifier, snake_case
from flightstack.firmware.generator.types import (
    NOTHING,
    Array,
    Record,
    Several,
    Single,
    Table,
    Type,
    annotated,
    prefix_of,
)

_TOOLS = re.compile(r"#\s*(noqa|type:|fmt:|pragma).*")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a function."""

    name: str
    type: Type
    default: ast.expr | None


@dataclass
class Function:
    """A Python function, and what its translation found out."""

    python: Callable[..., Any]
    node: ast.FunctionDef
    file: str
    line: int
    module: str
    names: dict[str, Any]
    comments: dict[int, str]
    """Comments by line of the file."""
    parameters: list[Parameter] = field(default_factory=list)
    result: Type = NOTHING
    written: set[str] = field(default_factory=set)
    """Array parameters that the function writes to."""
    bounds: set[str] = field(default_factory=set)
    """Integer parameters that bound a loop: every call gives them a bounded number."""
    needs_rotors: bool = False
    """The number of rotors is a parameter of its own in C."""
    sized: set[str] = field(default_factory=set)
    """Parameters that are arrays of any size, of which the function reads the size: a parameter of its own in C."""
    part: str = ""
    """Part of the parameter that a function returns, whose result is arrays of a record; it has no C of its own."""
    lines: list[str] = field(default_factory=list)
    """C text of the body."""

    @property
    def name(self) -> str:
        """Name in Python."""
        return self.node.name

    @property
    def is_private(self) -> bool:
        """True for a function of its module alone: static in C."""
        return self.name.startswith("_")

    @property
    def c_name(self) -> str:
        """Name in C."""
        if self.is_private:
            return static_name(self.name, self.module)
        return f"{prefix_of(self.module)}_{ascii_text(self.name)}"

    @property
    def place(self) -> str:
        """File and line of the definition."""
        return f"{Path(self.file).name}:{self.node.lineno}"

    @property
    def outputs(self) -> list[tuple[str, Type]]:
        """Names and types of the out-parameters of a function with several results."""
        if not isinstance(self.result, Several):
            return []
        named = _output_names(self.node, self.result)
        return [(f"{name}_out", kind) for name, kind in zip(named, self.result.items, strict=True)]

    def refusal(self, node: ast.AST, construct: str, detail: str = "") -> OutsideSubsetError:
        """Return the error for a node outside the subset."""
        line = getattr(node, "lineno", self.node.lineno)
        return OutsideSubsetError(self.file, line, detail or construct, ADVICE[construct])


def python_function(value: Any) -> Callable[..., Any] | None:
    """Return the Python function of a compiled or plain one, or None."""
    plain = getattr(value, "py_func", value)
    return plain if inspect.isfunction(plain) else None


def static_name(name: str, module: str) -> str:
    """Return the C name of a private function, which no parameter of a function of its module has."""
    plain = identifier(name.strip("_"))
    return f"{plain}_" if plain in _parameters_of(module) else plain


@functools.cache
def _parameters_of(module: str) -> frozenset[str]:
    functions = [python_function(value) for value in vars(sys.modules[module]).values()]
    codes = [function.__code__ for function in functions if isinstance(function, FunctionType)]
    names = (code.co_varnames[: code.co_argcount + code.co_kwonlyargcount] for code in codes)
    return frozenset(identifier(name) for several in names for name in several)


def load(value: Any) -> Function:
    """Read a function's source and signature; raise OutsideSubsetError."""
    python = python_function(value)
    assert python is not None
    file = inspect.getsourcefile(python) or "?"
    first = python.__code__.co_firstlineno
    try:
        source = textwrap.dedent(inspect.getsource(python))
        node = ast.parse(source).body[0]
    except (OSError, SyntaxError, IndexError):
        raise OutsideSubsetError(
            file, first, "function without source", ADVICE["function without source"]
        ) from None
    ast.increment_lineno(node, first - 1)
    if not isinstance(node, ast.FunctionDef):
        raise OutsideSubsetError(file, first, "lambda", ADVICE["lambda"])
    names = {**vars(__import__("builtins")), **python.__globals__}
    function = Function(python, node, file, first, python.__module__, names, _comments(source, first))
    _read_signature(function)
    return function


def _comments(source: str, first: int) -> dict[int, str]:
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            text = _TOOLS.sub("", token.string).lstrip("#").strip()
            if text:
                found[token.start[0] + first - 1] = text
    return found


def _read_signature(function: Function) -> None:
    arguments = function.node.args
    if arguments.vararg or arguments.kwarg:
        raise function.refusal(function.node, "arguments", "variable number of arguments")
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    positional = len(arguments.posonlyargs) + len(arguments.args)
    defaults: list[ast.expr | None] = [None] * (positional - len(arguments.defaults))
    defaults += [*arguments.defaults, *arguments.kw_defaults]
    for argument, default in zip(every, defaults, strict=True):
        kind = _type(function, argument, argument.annotation)
        if isinstance(kind, Several):
            raise function.refusal(argument, "tuple")
        function.parameters.append(Parameter(argument.arg, kind, default))
    function.result = _type(function, function.node, function.node.returns)
    if isinstance(function.result, Array):
        raise function.refusal(function.node, "annotation", "result that is an array")


def _type(function: Function, node: ast.AST, annotation: ast.expr | None) -> Type:
    if annotation is None:
        raise function.refusal(node, "annotation", "missing annotation")
    try:
        kind = annotated(annotation, function.names)
        _check_fields(kind)
    except TypeError as error:
        raise function.refusal(node, "annotation", str(error)) from None
    return kind


def _check_fields(kind: Type) -> None:
    """Raise TypeError if a field of a record is outside the subset."""
    if isinstance(kind, Record | Single | Table):
        record = kind if isinstance(kind, Record) else kind.record
        for inner in record.fields.values():
            _check_fields(inner)
    if isinstance(kind, Several):
        for inner in kind.items:
            _check_fields(inner)


def _output_names(node: ast.FunctionDef, result: Several) -> list[str]:
    """Return names of the results: those of the last return statement, else the types, else numbers."""
    count = len(result.items)
    made: list[str | None] = [None] * count
    returns = [inner.value for inner in ast.walk(node) if isinstance(inner, ast.Return)]
    for value in sorted((value for value in returns if value is not None), key=lambda value: value.lineno):
        if isinstance(value, ast.Tuple) and len(value.elts) == count:
            made = [element.id if isinstance(element, ast.Name) else None for element in value.elts]
    kinds = [
        snake_case(kind.kind.__name__) if isinstance(kind, Record) else "result" for kind in result.items
    ]
    names = [identifier(name).strip("_") if name else kind for name, kind in zip(made, kinds, strict=True)]
    return [f"{name}_{at + 1}" if names.count(name) > 1 else name for at, name in enumerate(names)]
