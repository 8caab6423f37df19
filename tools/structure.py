"""Print the figures of the code's structure: ``python -m tools.structure``."""

from __future__ import annotations

import ast
import re
import statistics
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = ("flightstack", "sim_bridge", "gcs_cli")
SMALL = 60
INDEX = re.compile(r"[A-Z]+_[A-Z0-9_]+$")


def sources(program: str) -> dict[str, ast.Module]:
    """Return the modules of a program by name; packages are named without ``__init__``."""
    found = {}
    for path in sorted((ROOT / program).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts).removesuffix(".__init__")] = ast.parse(path.read_text())
    return found


def lines(program: str) -> list[int]:
    """Return the number of lines of each file but ``__init__.py`` and generated ones."""
    paths = (ROOT / program).rglob("*.py")
    return [
        len(path.read_text().splitlines())
        for path in paths
        if path.name != "__init__.py" and not path.stem.endswith("_generated")
    ]


def has_one_small_definition(tree: ast.Module) -> bool:
    """Return True for a module whose only function or class has at most SMALL lines."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    found = [node for node in tree.body if isinstance(node, kinds)]
    return len(found) == 1 and (found[0].end_lineno or 0) - found[0].lineno < SMALL


def has_one_definition(tree: ast.Module) -> bool:
    """Return True for a module with a single function or class at its top."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    return sum(isinstance(node, kinds) for node in tree.body) == 1


def index_constants(tree: ast.Module) -> int:
    """Return how often an array is indexed by a named constant such as ``M_SPEED``."""
    slices = (node.slice for node in ast.walk(tree) if isinstance(node, ast.Subscript))
    parts = (part for index in slices for part in (index.elts if isinstance(index, ast.Tuple) else [index]))
    return sum(isinstance(part, ast.Name) and bool(INDEX.match(part.id)) for part in parts)


def imports(name: str, tree: ast.Module, known: set[str]) -> Iterator[tuple[str, str]]:
    """Yield the packages of a module and of what it imports, where they differ."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                imported = full if full in known else node.module
                ours, theirs = (".".join(each.split(".")[:2]) for each in (name, imported))
                if imported in known and ours != theirs:
                    yield ours, theirs


def cycles(modules: dict[str, ast.Module]) -> list[str]:
    """Return the packages that reach themselves over their imports."""
    edges: dict[str, set[str]] = defaultdict(set)
    for name, tree in modules.items():
        for ours, theirs in imports(name, tree, set(modules)):
            edges[ours].add(theirs)

    def reaches(start: str) -> bool:
        waiting, seen = list(edges[start]), set[str]()
        while waiting:
            package = waiting.pop()
            if package == start:
                return True
            if package not in seen:
                seen.add(package)
                waiting.extend(edges[package])
        return False

    return [package for package in list(edges) if reaches(package)]


def main() -> None:
    """Print a table in Markdown."""
    print(
        "| | files | median lines | p90 | one definition | small ones of them | index constants | packages in cycles |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for program in PROGRAMS:
        modules, sizes = sources(program), lines(program)
        row = (
            program,
            len(sizes),
            round(statistics.median(sizes)),
            round(statistics.quantiles(sizes, n=10)[-1]),
            sum(map(has_one_definition, modules.values())),
            sum(map(has_one_small_definition, modules.values())),
            sum(map(index_constants, modules.values())),
            len(cycles(modules)),
        )
        print("|", " | ".join(map(str, row)), "|")


if __name__ == "__main__":
    main()
