"""Stack of each function and the deepest call path, as GCC reports them with ``-fcallgraph-info=su``.

They are GCC's frames, not those of the image that another compiler makes with link-time optimisation; a target reports
its own high-water mark. A call out of the given sources ends a path, and so does a call through a
pointer, with which the deepest path is no bound.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.core.atomic_file import write_text_atomically
from flightstack.firmware.sources import PORTABLE, c_files, source_hash
from flightstack.firmware.toolchain.build import (
    COMPILE_LIMIT_S,
    EXACT,
    cache_root,
    compiler_version,
    includes,
)

_CORTEX_M4 = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-ffreestanding")
_COMPILERS = (("arm-none-eabi-gcc", _CORTEX_M4, "Cortex-M4F"), ("gcc", (), "this machine"))
_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]+)"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_POINTER = "__indirect_call"
"""GCC's node for the target of a call through a pointer."""
_FORM = b"2"
"""Form and meaning of the kept result."""
_BYTES = re.compile(r"(\d+) bytes \((\w+)")


class StackUsage(NamedTuple):
    """Frames of functions and the deepest path from the roots."""

    compiler: str
    """Version, and the processor that it compiled for."""
    frames: Mapping[str, int]
    """Bytes of each function, the largest first."""
    path: tuple[str, ...]
    """Functions of the deepest path, the outermost first."""
    total: int
    """Bytes of that path."""
    is_bounded: bool
    """False if a frame has a variable size, a call is through a pointer, or the calls have a cycle."""


class _Graph(NamedTuple):
    frames: dict[str, int]
    calls: dict[str, set[str]]
    unbounded: set[str]


def stack_usage() -> StackUsage | None:
    """Return the stack usage of the portable sources, kept from call to call; None without a GCC that reports it."""
    for command, flags, processor in _COMPILERS:
        if shutil.which(command) is None or "clang" in (version := compiler_version([command])):
            continue
        compiler = f"{version}, for {processor}"
        kept = _place(compiler)
        try:
            return _of_json(json.loads(kept.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            graph = _compiled([command, *flags])
        if graph is None:
            continue
        path, total, is_bounded = deepest(graph)
        frames = dict(sorted(graph.frames.items(), key=lambda item: (-item[1], item[0])))
        usage = StackUsage(compiler, frames, path, total, is_bounded)
        with suppress(OSError):  # the next call computes it again
            kept.parent.mkdir(parents=True, exist_ok=True)
            write_text_atomically(kept, json.dumps(usage._asdict()))
        return usage
    return None


def _place(compiler: str) -> Path:
    """Return the file that keeps the result for these sources and this compiler."""
    key = hashlib.sha256(_FORM + source_hash() + compiler.encode()).hexdigest()[:16]
    return cache_root() / "stack" / f"{key}.json"


def _of_json(content: Any) -> StackUsage:
    usage = StackUsage(**content)
    return usage._replace(path=tuple(usage.path))


def _compiled(command: Sequence[str]) -> _Graph | None:
    sources = [path for folder in PORTABLE for path in c_files(folder)]
    with tempfile.TemporaryDirectory() as folder:
        flags = [*EXACT, *includes(*PORTABLE), "-fcallgraph-info=su", "-c"]
        try:
            done = subprocess.run(
                [*command, *flags, *map(str, sources)], capture_output=True, check=False, cwd=folder,
                timeout=COMPILE_LIMIT_S,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            return None
        texts = [path.read_text(encoding="utf-8") for path in sorted(Path(folder).glob("*.ci"))]
    return read_graphs(texts) if done.returncode == 0 and texts else None


def read_graphs(texts: Sequence[str]) -> _Graph:
    """Return the call graph of all files. A static function bears the name of its file too."""
    graph = _Graph({}, {}, set())
    for text in texts:
        for title, label in _NODE.findall(text):
            size = _BYTES.search(label)
            if size is not None:
                name = _short(title)
                graph.frames[name] = int(size[1])
                if size[2] != "static":
                    graph.unbounded.add(name)
        for caller, callee in _EDGE.findall(text):
            graph.calls.setdefault(_short(caller), set()).add(_short(callee))
    return graph


def _short(title: str) -> str:
    """Return ``file.c:function`` of a static function, without folders, or the function."""
    place, colon, name = title.rpartition(":")
    return f"{Path(place).name}:{name}" if colon else name


def deepest(graph: _Graph) -> tuple[tuple[str, ...], int, bool]:
    """Return the path with the largest sum of frames, its bytes, and True if it is a bound."""
    known: dict[str, tuple[int, tuple[str, ...]]] = {}
    cyclic = False

    def below(name: str, above: frozenset[str]) -> tuple[int, tuple[str, ...]]:
        nonlocal cyclic
        if name in above:
            cyclic = True
            return 0, ()
        if name not in known:
            inner = above | {name}
            callees = [below(callee, inner) for callee in sorted(graph.calls.get(name, ()))]
            size, path = max(callees, default=(0, ()), key=lambda found: found[0])
            own = graph.frames.get(name)
            known[name] = (size, path) if own is None else (own + size, (name, *path))
        return known[name]

    total, path = max((below(name, frozenset()) for name in graph.frames), key=lambda found: found[0])
    by_pointer = any(_POINTER in callees for callees in graph.calls.values())
    return path, total, not (cyclic or graph.unbounded or by_pointer)
