"""Compile and check C once for each state of sources, tool and flags; workers and later runs share the result."""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from flightstack.firmware.toolchain.build import compiler_version

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (ROOT / "firmware", Path(__file__).parent / "c")
KEPT_STATES = 24


@functools.cache
def _folder() -> Path:
    """Return the folder for this state of the C sources; delete the oldest ones."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in FOLDERS for path in folder.rglob("*.[chS]")):
        digest.update(f"{path}\0".encode() + path.read_bytes())
    base = Path(tempfile.gettempdir()) / f"flightstack-builds-{os.getuid()}"
    folder = base / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    states = sorted(base.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
    for old in states[KEPT_STATES:]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


@contextmanager
def alone(output: Path) -> Iterator[None]:
    """Wait for another process that makes the same output."""
    with output.with_name(f".{output.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


_version = functools.cache(compiler_version)


@functools.cache
def kept_build(name: str, compiler: tuple[str, ...], *words: str | Path) -> Path:
    """Return the output of ``compiler words -o``; a failure shows the compiler's messages.

    A process waits for another one that compiles the same. The output has a folder of its own, which is the
    compiler's working directory, so that the notes of gcov stand beside it.
    """
    command = [*compiler, *map(str, words)]
    key = hashlib.sha256("\0".join([_version(compiler), *command]).encode()).hexdigest()[:16]
    folder = _folder() / f"{name}-{key}"
    with alone(folder):
        if not folder.exists():
            with tempfile.TemporaryDirectory(dir=_folder(), prefix=".") as place:
                fresh = Path(place) / "fresh"
                fresh.mkdir()
                _compile(command, fresh / name)
                fresh.replace(folder)
    return folder / name


def kept_text(name: str, tool: tuple[str, ...], inputs: Sequence[Path], look: Callable[[], str]) -> str:
    """Return what ``look`` finds by a tool in the C sources; once for each state of them, tool and ``inputs``.

    Among the inputs are the files that say how the tool is called. Nothing is kept of a ``look`` that raises.
    """
    digest = hashlib.sha256(_version(tool).encode())
    for path in inputs:
        digest.update(f"\0{path}\0".encode() + path.read_bytes())
    place = _folder() / f"{name}-{digest.hexdigest()[:16]}.txt"
    with alone(place):
        if not place.exists():
            text = look()
            fresh = place.with_suffix(f".{os.getpid()}")
            fresh.write_text(text, encoding="utf-8")
            fresh.replace(place)
    return place.read_text(encoding="utf-8")


def _compile(command: Sequence[str], output: Path) -> None:
    done = subprocess.run(
        [*command, "-o", output.name], check=False, capture_output=True, text=True, cwd=output.parent
    )
    assert done.returncode == 0, done.stderr
