"""What flights depend on besides the files of their scenario: version, source code, and files that come with them."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from flightstack import __version__
from flightstack.firmware.sources import source_hash

FLYING = ("flightstack", "sim_bridge")
"""Packages that fly."""
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")
_JUDGING = "gcs_cli"
"""The package that makes a row of a flight."""
_ONLY_IN_WHEEL = "missions"
"""Folder of ``gcs_cli`` in a wheel, elsewhere in a clone: an example that a campaign flies is compared by itself."""
_SOURCES = frozenset((".py", ".toml", ".xml"))


def sources_digest(packages: Sequence[str]) -> str:
    """Return a digest of the source code: an edit of a law of this project changes flights too."""
    result = hashlib.sha256(source_hash())  # of the loops in C
    for package in map(_folder, packages):
        names = sorted(path.relative_to(package) for path in package.rglob("*") if path.suffix in _SOURCES)
        for name in names:
            if name.parts[0] != _ONLY_IN_WHEEL:
                result.update(str(name).encode())
                result.update((package / name).read_bytes())
    return result.hexdigest()


def _folder(package: str) -> Path:
    spec = find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def installation() -> dict[str, str]:
    """Return what makes the rows of two machines equal: versions and a digest of the source code."""
    libraries = {name: version(name) for name in _LIBRARIES}
    sources = sources_digest((*FLYING, _JUDGING))
    return {"flightstack": __version__, "Python": platform.python_version(), **libraries, "sources": sources}


def digests(files: Iterable[Path]) -> dict[str, str]:
    """Return a digest of the files of each name; raise OSError."""
    contents: dict[str, list[bytes]] = {}
    for path in files:
        contents.setdefault(path.name, []).append(hashlib.sha256(path.read_bytes()).digest())
    return {name: hashlib.sha256(b"".join(sorted(each))).hexdigest() for name, each in contents.items()}


def difference(wanted: Mapping[str, str], found: Mapping[str, str]) -> str:
    """Return what differs from ``installation`` or ``digests`` of the client, as the end of a sentence, or empty."""
    for name, value in wanted.items():
        has = found.get(name)
        if has != value:
            if name == "sources":
                return "has other source code of flightstack than the client"
            is_version = name in ("flightstack", "Python", *_LIBRARIES)
            return (
                f"has {name} {has}, the client {value}"
                if is_version
                else f"has another {name} than the client"
            )
    return ""
