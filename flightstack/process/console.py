"""Print lines to stdout and stderr; a closed pipe or a full disk does not end the process."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import IO

OUTPUT_ERRORS = frozenset({errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF})
"""Errors of writing to stdout, which name no file."""
_lost: list[tuple[IO[str], OSError]] = []
"""Streams of which output was lost, and why."""


def replace_unencodable() -> None:
    """Print "?" for characters outside the encoding of stdout or stderr."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None if closed
            stream.reconfigure(errors="replace")


def say(line: object) -> Exception | None:
    """Print a line to stdout; return the error of a failure, or None."""
    return _print(line, sys.stdout)


def complain(line: object) -> None:
    """Print a line to stderr; ignore errors."""
    _print(line, sys.stderr)


def _print(line: object, stream: IO[str] | None) -> Exception | None:
    if stream is None:  # closed before the start
        return None
    try:
        print(line, file=stream, flush=True)
    except (OSError, ValueError) as error:
        if isinstance(error, ValueError) and not stream.closed:
            raise
        lose(stream, error)
        return error
    return None


def lose(stream: IO[str], error: Exception) -> None:
    """Discard all further output of a stream after an error; the program goes on until ``check_output``."""
    if isinstance(error, OSError) and error.errno in OUTPUT_ERRORS - {errno.EPIPE}:
        _lost.append((stream, error))  # the reader of a closed pipe needs no message
    drop(stream)


def check_output() -> None:
    """Flush stdout; raise OSError if it fails, or if output to stdout was lost before. Call at a program's end."""
    if sys.stdout is not None:
        sys.stdout.flush()
    errors = [error for stream, error in _lost if stream is sys.stdout]
    _lost.clear()
    if errors:
        raise errors[0]


def checked_code(code: int | None) -> int:
    """Return the exit code of a program that ends; raise OSError if one that succeeded has lost output."""
    if not code:
        check_output()
    return code or 0


def report_os_error(program: str, error: OSError) -> int:
    """Print an error of a named file or of stdout that ended ``program``, and return the exit code.

    Any other error is raised again.
    """
    if error.filename is None and error.errno not in OUTPUT_ERRORS:
        raise error
    drop(sys.stdout)
    if not isinstance(error, BrokenPipeError):  # the reader of a closed pipe needs no message
        where = "" if error.filename is None else f"{error.filename}: "
        complain(f"{program}: {where}{error.strerror}")
    return 1


def drop(stream: IO[str] | None) -> None:
    """Redirect a stream to /dev/null, so that flushing it at exit cannot fail."""
    if stream is None:
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    except (OSError, ValueError):  # no descriptor, or closed
        return
