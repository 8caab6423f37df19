"""Print the figures of the code's structure: ``python -m tools.structure``."""

from __future__ import annotations

import ast
import gc
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = ("flightstack", "sim_bridge", "gcs_cli")
SMALL = 60
LONGEST_FUNCTION = 40
COLUMNS = (
    "files",
    "median lines",
    "p90",
    "one definition",
    "small ones without a reason",
    "long functions",
    "index constants",
    "packages in cycles",
)
LIBRARY_NAMES = {"_replace", "_fields", "_asdict", "_header", "_pack", "_timestamp", "_link", "_time"}
"""Private by their form: of named tuples, of messages of pymavlink, and a module of Textual."""
_KINDS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
ROWS = ("flightstack.estimation.error_state", "flightstack.estimation.kalman")
"""Modules whose numbers name the rows of the covariance and of the filter's observations, as PX4's ``State::``."""


@cache
def sources(program: str) -> dict[str, ast.Module]:
    """Return the modules of a program by name; packages are named without ``__init__``.

    Without garbage collection, which finds nothing and would take two thirds of the time.
    """
    found = {}
    collects = gc.isenabled()
    gc.disable()
    try:
        for path in sorted((ROOT / program).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = ast.parse(path.read_text())
    finally:
        if collects:
            gc.enable()
    return found


@cache
def nodes(program: str) -> dict[str, list[ast.AST]]:
    """Return all nodes of each module of a program: most figures look at each of them."""
    return {name: walk(tree) for name, tree in sources(program).items()}


@cache
def walk(tree: ast.Module) -> list[ast.AST]:
    """Return all nodes of a module but the contexts of names, in a third of the time of ``ast.walk``."""
    found: list[ast.AST] = [tree]
    for node in found:  # which grows
        for part in vars(node).values():
            if isinstance(part, list):
                found += [item for item in part if isinstance(item, ast.AST)]
            elif isinstance(part, ast.AST) and not isinstance(part, ast.expr_context):
                found.append(part)
    return found


def forget() -> None:
    """Drop the modules and their nodes, of which each garbage collection would look at millions."""
    for kept in (sources, nodes, walk, numbers_of):
        kept.cache_clear()


def lines(program: str) -> list[int]:
    """Return the number of lines of each file but ``__init__.py`` and generated ones."""
    paths = (ROOT / program).rglob("*.py")
    return [
        len(path.read_text().splitlines())
        for path in paths
        if path.name != "__init__.py" and not path.stem.endswith("_generated")
    ]


def has_one_definition(tree: ast.Module) -> bool:
    """Return True for a module with a single function or class at its top; a package's ``__getattr__`` is none."""
    return len(_definitions(tree)) == 1


def has_one_small_definition(tree: ast.Module) -> bool:
    """Return True for a module whose only function or class has at most SMALL lines, and that does not say why."""
    found = _definitions(tree)
    is_small = len(found) == 1 and (found[0].end_lineno or 0) - found[0].lineno < SMALL
    return is_small and not is_own_module(tree)


def _definitions(tree: ast.Module) -> list[ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef]:
    return [node for node in tree.body if isinstance(node, _KINDS) and node.name != "__getattr__"]


def is_own_module(tree: ast.Module) -> bool:
    """Return True if the docstring of a module says why it is one: ``A module of its own``."""
    return "module of its own" in (ast.get_docstring(tree) or "")


def long_functions(modules: dict[str, ast.Module]) -> Iterator[str]:
    """Yield each function that is longer than LONGEST_FUNCTION, but those of generated modules."""
    for name, tree in modules.items():
        for node in walk(tree) if not name.endswith("_generated") else ():
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                length = (node.end_lineno or 0) - node.lineno + 1
                if length > LONGEST_FUNCTION:
                    yield f"{name}.{node.name}: {length} lines"


def private_names(module: Iterable[ast.AST]) -> set[str]:
    """Return the names with one underscore that a module defines: functions, classes, constants and attributes."""
    found = set()
    for node in module:
        if isinstance(node, _KINDS):
            found.add(node.name)
        elif isinstance(node, (ast.Name, ast.Attribute)) and isinstance(node.ctx, ast.Store):
            found.add(node.id if isinstance(node, ast.Name) else node.attr)
    return {name for name in found if name.startswith("_") and not name.startswith("__")}


def private_uses(modules: dict[str, list[ast.AST]]) -> Iterator[str]:
    """Yield each use of a private name of the programs in the nodes of other ``modules``, with its place.

    Uses are attributes, imports, and texts of ``setattr`` and ``getattr``. Attributes of ``self`` count if no class of
    these modules has them; those of named tuples and of the libraries ``LIBRARY_NAMES`` do not.
    """
    defined = (private_names(module) for program in PROGRAMS for module in nodes(program).values())
    names = set[str]().union(*defined) - LIBRARY_NAMES
    owned = {name: private_names(module) for name, module in modules.items()}
    own = set[str]().union(*owned.values())
    for module, found in modules.items():
        others = names - owned[module]
        for node in found:
            for name in _used(node, own):
                if name in others:
                    yield f"{module}:{node.lineno}: {name}"  # type: ignore[attr-defined]  # those with names have one


def _used(node: ast.AST, own: set[str]) -> list[str]:
    """Return the names that a node takes from others; attributes of ``self`` in ``own`` are no such names."""
    if isinstance(node, ast.Attribute):
        is_own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls") and node.attr in own
        return [] if is_own else [node.attr]
    if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in PROGRAMS:
        return [alias.name for alias in node.names]
    if isinstance(node, ast.Call) and _name(node.func) in ("setattr", "getattr"):
        texts = (part.value for part in node.args if isinstance(part, ast.Constant))
        return [text.rpartition(".")[2] for text in texts if isinstance(text, str)]
    return []


def _name(called: ast.expr) -> str:
    return (
        called.attr
        if isinstance(called, ast.Attribute)
        else called.id
        if isinstance(called, ast.Name)
        else ""
    )


def index_constants(name: str) -> list[str]:
    """Return where a module takes an element of an array by a number of its own or of another module.

    That is ``array[NUMBER]``, ``array[NUMBER + i]`` or ``array[i + NUMBER]``, not a key of a dictionary, a bound of a
    slice or a size in an annotation. Names of ``ROWS`` do not count, a matrix has no fields, and numbers that are
    computed from a layout such as ``LoopRow`` do not.
    """
    numbers = _known_numbers(name)
    found = []
    for node in nodes(name.partition(".")[0])[name]:
        if isinstance(node, ast.Subscript) and _name(node.value) != "Annotated":
            index = node.slice
            parts = index.elts if isinstance(index, ast.Tuple) else [index]
            terms = [term for part in parts for term in _terms(part)]
            if any(isinstance(term, ast.Name) and term.id in numbers for term in terms):
                found.append(f"{name}:{node.lineno}: {ast.unparse(node)}")
    return found


def _terms(index: ast.expr) -> list[ast.expr]:
    if isinstance(index, ast.BinOp) and isinstance(index.op, ast.Add):
        return [*_terms(index.left), *_terms(index.right)]
    return [index]


@cache
def numbers_of(name: str) -> set[str]:
    """Return the constants that a module of the programs sets to whole numbers."""
    program = name.partition(".")[0]
    tree = sources(program).get(name) if program in PROGRAMS and name not in ROWS else None
    found: set[str] = set()
    for node in tree.body if tree is not None else ():
        if isinstance(node, ast.Assign):
            found = found.union(*(_numbers(target, node.value, found) for target in node.targets))
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            found |= _numbers(node.target, node.value, found)
    return found


def _known_numbers(name: str) -> set[str]:
    """Return the constants that are whole numbers in a module: its own and imported ones."""
    found = set(numbers_of(name))
    for node in sources(name.partition(".")[0])[name].body:
        if isinstance(node, ast.ImportFrom) and node.module:
            theirs = numbers_of(node.module)
            found |= {alias.asname or alias.name for alias in node.names if alias.name in theirs}
    return found


def _numbers(target: ast.expr, value: ast.expr, known: set[str]) -> set[str]:
    """Return the names of ``target`` that get whole numbers: literals, and sums of them and of ``known`` names."""
    if isinstance(target, ast.Tuple):
        names = [part.id for part in target.elts if isinstance(part, ast.Name)]
        if isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=False)
            return set[str]().union(*(_numbers(part, number, known) for part, number in pairs))
        return set(names) if isinstance(value, ast.Call) and _name(value.func) == "range" else set()
    return {target.id} if isinstance(target, ast.Name) and _is_number(value, known) else set()


def _is_number(value: ast.expr, known: set[str]) -> bool:
    if isinstance(value, ast.BinOp):
        return _is_number(value.left, known) and _is_number(value.right, known)
    is_name = isinstance(value, ast.Name) and value.id in known
    return is_name or (isinstance(value, ast.Constant) and type(value.value) is int)


def imported(module: Iterable[ast.AST]) -> set[str]:
    """Return the names of the modules and members that a module imports."""
    found: set[str] = set()
    for node in module:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def imports(name: str, tree: ast.Module, known: set[str]) -> Iterator[tuple[str, str]]:
    """Yield the packages of a module and of what it imports, where they differ."""
    for node in walk(tree):
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
    known = set(modules)
    for name, tree in modules.items():
        for ours, theirs in imports(name, tree, known):
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
    print(f"| {' | '.join(('', *COLUMNS))} |\n{'|---' * (len(COLUMNS) + 1)}|")
    for program in PROGRAMS:
        modules, sizes = sources(program), lines(program)
        row = (
            program,
            len(sizes),
            round(statistics.median(sizes)),
            round(statistics.quantiles(sizes, n=10)[-1]),
            sum(map(has_one_definition, modules.values())),
            sum(map(has_one_small_definition, modules.values())),
            len(list(long_functions(modules))),
            sum(len(index_constants(name)) for name in modules),
            len(cycles(modules)),
        )
        print("|", " | ".join(map(str, row)), "|")


if __name__ == "__main__":
    main()
