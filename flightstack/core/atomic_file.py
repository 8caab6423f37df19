"""Write a file whole or not at all. The only place that names temporary files beside files of the user."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from flightstack.core.errors import ConfigError

OWNER_ONLY = 0o600
_OPEN_TO_ALL = 0o666  # less the umask of the process
_LONGEST_TAIL = 60
"""Characters of a file's name that its temporary name ends with: the suffix is among them."""


def check_new(path: Path, overwrite: bool) -> None:
    """Raise ConfigError if a file that the user named is there already, unless it may be overwritten."""
    if not overwrite and path.is_file():
        raise ConfigError(path, "", "exists already: name another file, or give --overwrite")


def write_text_atomically(path: Path, text: str) -> None:
    """Replace the file at ``path``; the old one stays when writing fails. Raise OSError then."""
    write_bytes_atomically(path, text.encode())


def write_bytes_atomically(
    path: Path, data: bytes, mode: int | None = None, *, survives_power_loss: bool = True
) -> None:
    """Replace the file at ``path``; raise OSError when that fails, and the old one stays.

    The new file is on the disk before it takes the old one's name, and the name before this returns: a loss of power
    leaves the one or the other. Without ``survives_power_loss`` it does not wait for the disk.
    """
    try:
        with replacing(path, mode) as temporary, open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            if survives_power_loss and _is_replaceable(temporary):
                os.fsync(file.fileno())
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error  # it may name the temporary file
    if survives_power_loss:
        _sync_folder(Path(os.path.realpath(path)).parent)


@contextlib.contextmanager
def replacing(path: Path, mode: int | None = None) -> Iterator[Path]:
    """Give a new, empty file with the suffix of ``path``, which takes its place at the end; raise OSError.

    Its name is random and the file is made by this call, so that no file or link that was put there is written to.
    If anything fails the temporary file is removed and ``path`` stays as it was. The target of a link is replaced,
    not the link; a device or a pipe is written to, not replaced. Without ``mode`` the new file has the permissions of
    the old one.
    """
    if not _is_replaceable(path):  # before links are resolved: that of /dev/stdout may lead to "pipe:[1]"
        yield path
        return
    path = Path(os.path.realpath(path))
    is_kept = mode is None and path.exists()
    if mode is None:
        mode = path.stat().st_mode & 0o777 if is_kept else _OPEN_TO_ALL
    temporary = path.with_name(f".{secrets.token_hex(8)}.{path.name[-_LONGEST_TAIL:]}")
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode))
    try:
        if is_kept:
            temporary.chmod(mode)  # whatever the umask is now
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _is_replaceable(path: Path) -> bool:
    """Tell whether this is a regular file or none at all, and not the name of an open descriptor like /dev/stdout."""
    folder = os.path.realpath(path.parent)
    return folder != "/dev" and not folder.startswith("/proc/") and (path.is_file() or not path.exists())


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):  # some file systems cannot, and the file itself is safe
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
