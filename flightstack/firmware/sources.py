"""The C sources of the firmware: where they are, what belongs together, and the hash that names their state."""

from __future__ import annotations

import hashlib
from pathlib import Path

PORTABLE = ("core", "mavlink", "app")
"""Folders of what runs on every target."""
HASH_OCTETS = 8
"""So many octets of the hash does a target tell."""


def firmware_root() -> Path:
    """Return the folder ``firmware``: in the package where it is installed, else beside it."""
    here = Path(__file__).resolve().parent
    packaged = here / "c"
    return packaged if packaged.is_dir() else here.parents[1] / "firmware"


def c_files(folder: str) -> list[Path]:
    """Return the C files of a folder of the firmware, ``core`` or ``ports/host`` for instance, sorted by name."""
    return sorted((firmware_root() / folder).glob("*.c"))


def files(*folders: str) -> list[Path]:
    """Return C files and headers of folders, sorted by their path."""
    root = firmware_root()
    return sorted(path for folder in folders for path in (root / folder).glob("*.[ch]"))


def digest(paths: list[Path]) -> bytes:
    """Return the SHA-256 of files: of each its path below ``firmware``, a zero, its length, and its content."""
    root, total = firmware_root(), hashlib.sha256()
    for path in paths:
        content = path.read_bytes()
        total.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode())
        total.update(content)
    return total.digest()


def source_hash() -> bytes:
    """Return what a target with these sources tells as its hash: the first octets over all portable files."""
    return digest(files(*PORTABLE))[:HASH_OCTETS]
