"""Where a function assigns and reads its variables: decides where C declares them."""

from __future__ import annotations

import ast
from collections import defaultdict

Path = tuple[int, ...]
"""Blocks around a statement, outermost first; the body of the function is ()."""


class Usage(ast.NodeVisitor):
    """Assignments and reads of each name of a function, by block."""

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
