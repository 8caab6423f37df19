"""Write a file whole or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

OPEN_TO_ALL = 0o666
"""File mode, of which the process's umask takes its part."""


def write_text_atomically(path: Path, text: str) -> None:
    """Replace the file at ``path``; the old one stays when writing fails. Raise OSError then."""
    write_bytes_atomically(path, text.encode())


def write_bytes_atomically(path: Path, data: bytes, mode: int = OPEN_TO_ALL) -> None:
    """Replace the file at ``path``; raise OSError when that fails, and the old one stays.

    The new file is on the disk before it takes the old one's name, and the name before this returns: a loss of power
    leaves the one or the other.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, mode), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    _keep_names(path.parent)


def _keep_names(folder: Path) -> None:
    with contextlib.suppress(OSError):  # some file systems cannot, and the file itself is safe
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
