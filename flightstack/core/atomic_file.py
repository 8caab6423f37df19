"""Atomic file replacement."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from flightstack.core.errors import ConfigError

OWNER_ONLY = 0o600
_OPEN_TO_ALL = 0o666  # reduced by the umask
_LONGEST_NAME_BYTES = 255
_LONGEST_TAIL = 60
"""Characters of the file name, suffix included, that end the name of its temporary file."""


def check_new(path: Path, overwrite: bool) -> None:
    """Raise ConfigError if the file exists and must not be overwritten."""
    if not overwrite and path.is_file():
        raise ConfigError(path, "", "exists already: name another file or give --overwrite")


def check_creatable(path: Path, *, is_folder: bool = False) -> None:
    """Raise ConfigError if a file, or a folder for files, in folders that may be missing, cannot be written."""
    nearest = next(place for place in (path, *path.absolute().parents) if os.path.lexists(place))
    has_entries = nearest.is_dir()
    if any(len(os.fsencode(part)) > _LONGEST_NAME_BYTES for part in path.parts):
        code = errno.ENAMETOOLONG
    elif not os.path.exists(nearest):
        code = _link_error(nearest)
    elif nearest == path and has_entries and not is_folder:
        code = errno.EISDIR
    elif not has_entries and (nearest != path or is_folder):
        code = errno.ENOTDIR
    elif not os.access(nearest, os.W_OK | os.X_OK if has_entries else os.W_OK):
        code = errno.EACCES
    else:
        return
    raise ConfigError(path, "", f"cannot be written: {os.strerror(code)}")


def _link_error(link: Path) -> int:
    """Return the error code of a link to a missing file, to itself, or to a place that cannot be read."""
    try:
        link.stat()
    except OSError as error:
        return error.errno or errno.ENOENT
    return errno.ENOENT


def write_text_atomically(path: Path, text: str) -> None:
    """Replace the file at ``path``; raise OSError and keep the old file if writing fails."""
    write_bytes_atomically(path, text.encode())


def write_bytes_atomically(
    path: Path, data: bytes, mode: int | None = None, *, survives_power_loss: bool = True
) -> None:
    """Replace the file at ``path``; raise OSError and keep the old file if writing fails.

    File and directory are synced, so that after a power loss either the old or the new file is there. Without
    ``survives_power_loss`` nothing is synced.
    """
    with replacing(path, mode) as temporary, open(temporary, "wb") as file:
        file.write(data)
        file.flush()
        if survives_power_loss and _is_replaceable(temporary):
            os.fsync(file.fileno())
    if survives_power_loss:
        _sync_folder(Path(os.path.realpath(path)).parent)


@contextlib.contextmanager
def naming(path: Path, temporary: Path) -> Iterator[None]:
    """Name ``path``, as the user gave it, in an OSError that names no file, or ``temporary`` or a file in it."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and not str(error.filename).startswith(str(temporary)):
            raise
        reason = os.strerror(error.errno) if error.errno else error.strerror or str(error)
        raise OSError(error.errno, reason, str(path)) from error


@contextlib.contextmanager
def replacing(path: Path, mode: int | None = None) -> Iterator[Path]:
    """Yield a new, empty temporary file with the suffix of ``path``, and rename it to ``path`` at the end.

    Its name is random and it is created exclusively, so that an existing file or link is never written to. On an
    error the temporary file is removed and ``path`` is unchanged. The target of a link is replaced, not the link; a
    device or a pipe is yielded itself. Without ``mode`` the new file has the permissions of the old one. Raise OSError,
    which names ``path`` instead of the temporary file.
    """
    if not _is_replaceable(path):  # before links are resolved: /dev/stdout may link to "pipe:[1]"
        with naming(path, path):
            yield path
        return
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{secrets.token_hex(8)}.{target.name[-_LONGEST_TAIL:]}")
    with naming(path, temporary):
        is_kept = mode is None and target.exists()
        if mode is None:
            mode = target.stat().st_mode & 0o777 if is_kept else _OPEN_TO_ALL
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode))
        try:
            if is_kept:
                temporary.chmod(mode)  # independent of the umask
            yield temporary
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)


def _is_replaceable(path: Path) -> bool:
    """Return True for a regular or missing file that is no open descriptor such as /dev/stdout."""
    folder = os.path.realpath(path.parent)
    return folder != "/dev" and not folder.startswith("/proc/") and (path.is_file() or not path.exists())


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):  # not supported by some file systems; the file itself is synced
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
