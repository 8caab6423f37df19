"""Keep a file up to date without making the loops wait for the disk."""

from __future__ import annotations

import threading
from collections.abc import Callable


class FileSaver:
    """Writes a file after every change, in a thread of its own; many changes at once become one file.

    ``write`` is called in that thread and writes the newest state. If it raises an error, the sentence for the user
    begins with ``failure``, and the next change is written again.
    """

    def __init__(self, write: Callable[[], None], failure: str) -> None:
        self._write = write
        self._failure = failure
        self._error: Exception | None = None
        self._has_failed = False
        self._changed = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None

    def change(self) -> None:
        """Write the file soon."""
        self._changed.set()
        if self._thread is None and not self._closing:
            self._thread = threading.Thread(target=self._run, name="saver", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        while True:
            self._changed.wait()
            closing = self._closing  # before the changes are taken: none comes after it
            self._changed.clear()
            self._save()
            if closing:
                return

    def _save(self) -> None:
        try:
            self._write()
        except Exception as error:  # a saver that ends loses every later change
            if not self._has_failed:
                self._error = error
            self._has_failed = True
        else:
            self._has_failed = False

    def take_error(self) -> str | None:
        """Return the sentence why the file was not written, or None: one for each row of failures."""
        error, self._error = self._error, None
        if error is None:
            return None
        reason = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
        return f"{self._failure}: {reason or error}"

    def close(self) -> None:
        """Write what has changed, and end; a second call does nothing."""
        self._closing = True
        if self._thread is not None:
            self._changed.set()
            self._thread.join()
            self._thread = None
