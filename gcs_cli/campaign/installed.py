"""What flights depend on besides the files of their scenario: version, source code, and files that come with them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from flightstack import __version__
from flightstack.firmware.sources import source_hash

FLYING = ("flightstack", "sim_bridge")
"""Packages that fly."""
_JUDGING = "gcs_cli"
"""The package that makes a row of a flight."""
_SOURCES = frozenset((".py", ".toml", ".xml"))


def sources_digest(packages: Sequence[str]) -> str:
    """Return a digest of the source code: an edit of a law of this project changes flights too."""
    result = hashlib.sha256(source_hash())  # of the loops in C
    for package in map(_folder, packages):
        for path in sorted(path for path in package.rglob("*") if path.suffix in _SOURCES):
            result.update(str(path.relative_to(package)).encode())
            result.update(path.read_bytes())
    return result.hexdigest()


def _folder(package: str) -> Path:
    spec = find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def installation() -> dict[str, str]:
    """Return what makes the rows of two machines equal: version and a digest of the source code."""
    return {"version": __version__, "sources": sources_digest((*FLYING, _JUDGING))}


def digests(files: Iterable[Path]) -> dict[str, str]:
    """Return a digest of each file by its name; raise OSError."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def difference(wanted: Mapping[str, str], found: Mapping[str, str]) -> str:
    """Return what differs from ``installation`` or ``digests`` of the client, as the end of a sentence, or empty."""
    for name, value in wanted.items():
        has = found.get(name)
        if has != value:
            texts = {
                "version": f"flightstack {has}, the client {value}",
                "sources": "other source code of flightstack than the client",
            }
            return f"has {texts.get(name, f'another {name} than the client')}"
    return ""
