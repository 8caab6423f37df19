"""Prints lines on stdout and stderr: a closed pipe or a full disk behind the output never ends the process."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import IO

OUTPUT_ERRORS = frozenset({errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF})
"""What writing to stdout may raise. Its errors name no file."""


def replace_unencodable() -> None:
    """Print "?" for characters that the encoding of stdout or stderr does not have, such as × and °."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None when it is closed
            stream.reconfigure(errors="replace")


def say(line: object) -> Exception | None:
    """Print a line on stdout; return the error that prevents it, or None."""
    return _print(line, sys.stdout)


def complain(line: object) -> None:
    """Print a line on stderr; an error is ignored."""
    _print(line, sys.stderr)


def _print(line: object, stream: IO[str] | None) -> Exception | None:
    if stream is None:  # it was closed when the process began
        return None
    try:
        print(line, file=stream, flush=True)
    except (OSError, ValueError) as error:
        if isinstance(error, ValueError) and not stream.closed:
            raise
        drop(stream)
        return error
    return None


def report_os_error(program: str, error: OSError) -> int:
    """Report the error that ended ``program``, and return the exit code.

    That is an error of the file that it names, or of stdout; any other is raised again.
    """
    if error.filename is None and error.errno not in OUTPUT_ERRORS:
        raise error
    drop(sys.stdout)
    if not isinstance(error, BrokenPipeError):  # a reader that closed the pipe has read enough
        where = "" if error.filename is None else f"{error.filename}: "
        complain(f"{program}: {where}{error.strerror}")
    return 1


def drop(stream: IO[str] | None) -> None:
    """Redirect a stream to /dev/null: an error while Python flushes it at exit would be printed."""
    if stream is None:
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    except (OSError, ValueError):  # it has no descriptor, or is closed
        return
