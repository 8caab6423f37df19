"""Location and hash of the firmware's C sources."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

PORTABLE = ("core", "mavlink", "app")
"""Folders of the code common to all targets."""
SENSING = ("core/estimation", "sensing")
"""Folders of the estimator, for targets with room for it."""
SENSING_INCLUDES = (*PORTABLE, *SENSING, "laws")
"""Folders with the headers of a target with an estimator."""
HASH_SIZE = 8
"""Bytes of the hash in FS_PIL_IDENTITY."""


_root: ContextVar[Path | None] = ContextVar("firmware_root", default=None)


@contextmanager
def using_firmware(root: Path) -> Iterator[None]:
    """Use the firmware in another folder, with a user's controller, within the context."""
    token = _root.set(root)
    try:
        yield
    finally:
        _root.reset(token)


def firmware_root() -> Path:
    """Return the folder ``firmware``: of ``using_firmware``, in an installed package, or in the repository."""
    chosen = _root.get()
    if chosen is not None:
        return chosen
    here = Path(__file__).resolve().parent
    packaged = here / "c"
    return packaged if packaged.is_dir() else here.parents[1] / "firmware"


def c_files(folder: str) -> list[Path]:
    """Return the C files of a firmware folder such as ``core`` or ``ports/host``, sorted by name."""
    return sorted((firmware_root() / folder).glob("*.c"))


def files(*folders: str) -> list[Path]:
    """Return the C files and headers of folders, sorted by path."""
    root = firmware_root()
    return sorted(path for folder in folders for path in (root / folder).glob("*.[ch]"))


def digest(paths: list[Path]) -> bytes:
    """Return the SHA-256 over files: for each the path below ``firmware``, a zero, the length and the content."""
    root, total = firmware_root(), hashlib.sha256()
    for path in paths:
        content = path.read_bytes()
        total.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode())
        total.update(content)
    return total.digest()


def source_hash() -> bytes:
    """Return the hash reported by a target with these sources: the first bytes of the digest of all portable files.

    The estimator's count too, also for a target without it.
    """
    return digest(files(*PORTABLE, *SENSING))[:HASH_SIZE]


def sensing_files() -> list[Path]:
    """Return the C files of a target with an estimator: those common to all targets, and the estimator's."""
    return [path for folder in (*PORTABLE, *SENSING) for path in c_files(folder)]
