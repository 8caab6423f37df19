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
        self._untold: Exception | None = None
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
            self.save()
            if closing:
                return

    def save(self) -> None:
        """Write the file now, in this thread; an error is kept for ``take_error`` and ``problem``."""
        try:
            self._write()
        except Exception as error:  # a saver that ends loses every later change
            if self._error is None:
                self._untold = error
            self._error = error
        else:
            self._error = None

    def problem(self) -> str | None:
        """Return the sentence why the newest state is not in the file, or None if it is."""
        return self._sentence(self._error)

    def _sentence(self, error: Exception | None) -> str | None:
        if error is None:
            return None
        reason = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
        return f"{self._failure}: {reason or error}"

    def take_error(self) -> str | None:
        """Return the sentence why the file was not written, or None: one for each row of failures."""
        error, self._untold = self._untold, None
        return self._sentence(error)

    def flush(self) -> None:
        """Write what has changed before returning; later changes are written too."""
        self.close()
        self._closing = False

    def close(self) -> None:
        """Write what has changed, and end; a second call does nothing."""
        self._closing = True
        if self._thread is not None:
            self._changed.set()
            self._thread.join()
            self._thread = None
