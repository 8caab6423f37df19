"""Read a log while it is written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path


class FileTail:
    """A growing file, read from its beginning; implements ``services.logs.log_stream.LogTail``."""

    def __init__(self, path: Path, is_open: Callable[[], bool]) -> None:
        """Open ``path``, raise OSError; ``is_open`` tells whether somebody still writes to it."""
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._offset = 0
        self._is_open = is_open

    def read(self, count: int) -> bytes:
        """Return the next bytes, at most ``count``; none if nothing new is there or the file cannot be read."""
        try:
            data = os.pread(self._descriptor, count, self._offset) if self._descriptor >= 0 else b""
        except OSError:
            return b""
        self._offset += len(data)
        return data

    @property
    def ended(self) -> bool:
        """Whether nothing will be added."""
        return self._descriptor < 0 or not self._is_open()

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
