"""Cache directories of compiled kernels, keyed by the sources of each kernel.

Numba's cache detects a change in the file of a function, but not in the files that it calls into. A compiled function
only uses names that its module imports, so the key covers the module and everything that it imports from our packages,
directly or not. An edit of any of them recompiles the kernel, and an edit elsewhere recompiles nothing.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path

OWN_PACKAGES = ("flightstack", "sim_bridge")
STARTED_S = time.time()
"""Time of the import of this module: sources that are newer are not those that this process runs [s]."""
_KEPT_S = 14 * 86_400.0
"""Lifetime of a directory after its last use."""
_TEMPORARY = "flightstack-kernels-"
_IMPORT = re.compile(
    rf"\n[ \t]*(?:from[ \t]+((?:{'|'.join(OWN_PACKAGES)})[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]+)"
    rf"|import[ \t]+((?:{'|'.join(OWN_PACKAGES)})[^\n]*)"
    rf"|importlib\.import_module\(\"((?:{'|'.join(OWN_PACKAGES)})[\w.]*)\"\))"
)


def is_own(module_name: str) -> bool:
    """Return True if a module belongs to this project, so that ``digest`` covers its sources."""
    return module_name.partition(".")[0] in OWN_PACKAGES


@cache
def _path(top: Path, module_name: str) -> Path | None:
    """Return the file of a module; None for the name of something in a module."""
    parent, _, name = module_name.rpartition(".")
    package = _path(top, parent) if parent else None
    if package is not None and package.name != "__init__.py":  # a module: most imported names are in one
        return None
    folder = top.joinpath(*parent.split(".")) if package is None else package.parent
    if name in _entries(folder) and "__init__.py" in _entries(folder / name):
        return folder / name / "__init__.py"
    return folder / f"{name}.py" if f"{name}.py" in _entries(folder) else None


@cache
def _entries(folder: Path) -> frozenset[str]:
    """Return the names in a folder, none if it is no folder."""
    try:
        return frozenset(os.listdir(folder))
    except OSError:
        return frozenset()


def _imports(text: str) -> set[str]:
    """Return all module names that a source may import; an imported name may itself be a module."""
    found: set[str] = set()
    for package, names, plain, late in _IMPORT.findall(f"\n{text}"):
        if late:
            found.add(late)
            continue
        if plain:
            found.update(name.split()[0] for name in plain.split(",") if name.strip())
            continue
        found.add(package)
        code = re.sub(r"#[^\n]*", "", names).strip("()")
        found.update(f"{package}.{name.split()[0]}" for name in code.split(",") if name.strip())
    return found


@cache
def read_source(path: Path) -> tuple[bytes, frozenset[str]]:
    """Return the content of a source file and the names that it imports; cached per process."""
    content = path.read_bytes()
    return content, frozenset(_imports(content.decode("utf-8", "replace")))


def sources(top: Path, module_names: Iterable[str]) -> list[Path]:
    """Return the files of the modules and of all own modules that they import, directly or not, sorted."""
    waiting, found = list(module_names), set[Path]()
    while waiting:
        name = waiting.pop()
        path = _path(top, name)
        if path is not None and path not in found:
            found.add(path)
            waiting.extend(read_source(path)[1])
            waiting.extend(parent for parent in (name.rpartition(".")[0],) if parent)
    return sorted(found)


def digest(top: Path, module_names: Iterable[str], version: str) -> str:
    """Return a digest of ``version`` and of all sources of these modules."""
    result = hashlib.sha256(version.encode())
    for path in sources(top, module_names):
        result.update(str(path.relative_to(top)).encode())
        result.update(read_source(path)[0])
    return result.hexdigest()[:16]


@cache
def base_directory() -> Path:
    """Return the directory of all kernels: below the user's cache, or a temporary one if that is read-only."""
    caches = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    base = Path(caches) / "flightstack" / "kernels"
    with suppress(OSError):
        base.mkdir(parents=True, exist_ok=True)
        _remove_old(base.iterdir())
    if os.access(base, os.W_OK):
        return base
    with suppress(OSError):
        _remove_old(Path(tempfile.gettempdir()).glob(f"{_TEMPORARY}*"))
    return Path(tempfile.mkdtemp(prefix=_TEMPORARY))  # compile in each process


def _remove_old(folders: Iterable[Path]) -> None:
    oldest_s = time.time() - _KEPT_S
    for folder in folders:
        if folder.stat().st_mtime < oldest_s:
            shutil.rmtree(folder, ignore_errors=True)


def is_shared() -> bool:
    """Return True if all processes of this user share the cache."""
    return base_directory().name == "kernels"


@cache
def directory(module_names: frozenset[str], version: str) -> Path | None:
    """Return the cache directory for kernels made from these modules; ``version`` is the compiler's.

    It is None if a source was replaced since this process started, which may run the version before. The time of the
    change in the file system tells, since a file may be replaced by one with an older time of its own.
    """
    top = Path(__file__).resolve().parents[3]
    if any(path.stat().st_ctime > STARTED_S for path in sources(top, module_names)):
        return None
    path = base_directory() / digest(top, module_names, version)
    path.mkdir(parents=True, exist_ok=True)
    os.utime(path)
    return path
