"""Analysis of a function: the blocks that use its variables, and the bounds that its loops may have."""

from __future__ import annotations

import ast
from collections import defaultdict
from typing import TYPE_CHECKING

from flightstack.firmware.generator.law import Function

if TYPE_CHECKING:
    from flightstack.firmware.generator.expressions import Expressions
    from flightstack.firmware.generator.writer import Writer

Path = tuple[int, ...]
"""Blocks around a statement, outermost first; the body of the function is ()."""


class Usage(ast.NodeVisitor):
    """Assignments and reads of each name of a function, by block: they decide where C declares a variable."""

    def __init__(self, node: ast.FunctionDef) -> None:
        self.stores: dict[str, list[Path]] = defaultdict(list)
        self.loads: dict[str, list[Path]] = defaultdict(list)
        self.loop_variables: set[str] = set()
        self._path: Path = ()
        self._blocks: dict[int, Path] = {}
        self._count = 0
        for statement in node.body:
            self.visit(statement)

    def block(self, statements: list[ast.stmt]) -> Path:
        """Return the path of a block of statements."""
        return self._blocks[id(statements[0])]

    def home(self, name: str) -> Path:
        """Return the innermost block that has every use of a name."""
        paths = self.stores[name] + self.loads[name]
        common = paths[0]
        for path in paths[1:]:
            length = min(len(common), len(path))
            same = next((at for at in range(length) if common[at] != path[at]), length)
            common = common[:same]
        return common

    def _enter(self, statements: list[ast.stmt]) -> None:
        if not statements:
            return
        outer, self._count = self._path, self._count + 1
        self._path = (*outer, self._count)
        self._blocks[id(statements[0])] = self._path
        for statement in statements:
            self.visit(statement)
        self._path = outer

    def visit_Name(self, node: ast.Name) -> None:
        """Note an assignment or a read."""
        uses = self.stores if isinstance(node.ctx, ast.Store) else self.loads
        uses[node.id].append(self._path)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Note both."""
        self.generic_visit(node)
        if isinstance(node.target, ast.Name):
            self.loads[node.target.id].append(self._path)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Leave the annotation out."""
        if node.value is not None:
            self.visit(node.value)
        self.visit(node.target)

    def visit_If(self, node: ast.If) -> None:
        """Enter both branches."""
        self.visit(node.test)
        self._enter(node.body)
        self._enter(node.orelse)

    def visit_For(self, node: ast.For) -> None:
        """Enter the body."""
        self.visit(node.iter)
        if isinstance(node.target, ast.Name):
            self.loop_variables.add(node.target.id)
        self._enter(node.body)


class Bounds:
    """Tests whether an expression may bound a loop of one function: it is known when the program is compiled."""

    def __init__(self, function: Function, writer: Writer, expressions: Expressions) -> None:
        self.function, self.writer, self.expressions = function, writer, expressions

    def accepts(self, node: ast.expr) -> bool:
        """Return True for constants, sizes of arrays, variables of loops, and sums and choices of them.

        An integer parameter is one too; then every call must give a bounded number.
        """
        parameters: set[str] = set()
        if not self._is_bounded(node, parameters):
            return False
        self.function.bounds |= parameters
        return True

    def _is_bounded(self, node: ast.expr, parameters: set[str]) -> bool:
        constant = self.expressions.constant(node)
        if isinstance(constant, int) and not isinstance(constant, bool):
            return True
        if isinstance(node, ast.Name):
            return self._is_bounded_name(node.id, parameters)
        if isinstance(node, ast.IfExp):
            return self._is_bounded(node.body, parameters) and self._is_bounded(node.orelse, parameters)
        if isinstance(node, ast.BinOp):
            return self._is_bounded(node.left, parameters) and self._is_bounded(node.right, parameters)
        return self._is_size(node)

    def _is_bounded_name(self, name: str, parameters: set[str]) -> bool:
        if name in self.writer.loops:
            return True
        if self.writer.is_whole_parameter(name):
            parameters.add(name)
            return True
        values = [value for target, value in self._assignments() if target == name]
        is_once = len(values) == 1 and len(self.writer.usage.stores[name]) == 1
        reads = {node.id for value in values for node in ast.walk(value) if isinstance(node, ast.Name)}
        return is_once and name not in reads and self._is_bounded(values[0], parameters)

    def _assignments(self) -> list[tuple[str, ast.expr]]:
        """Return names and values of the assignments to one name."""
        found: list[tuple[str, ast.expr]] = []
        for node in ast.walk(self.function.node):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                found.append((node.targets[0].id, node.value))
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
                found.append((node.target.id, node.value))
        return found

    def _is_size(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Subscript):
            return isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
        if isinstance(node, ast.Call):
            return self.expressions.constant(node.func) is len
        return isinstance(node, ast.Attribute) and node.attr == "size"
