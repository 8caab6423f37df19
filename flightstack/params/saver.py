"""Keep the parameter file up to date without making the loops wait for the disk."""

from __future__ import annotations

import threading
from pathlib import Path

from flightstack.params.param_file import LoadedParams, save
from flightstack.params.store import ParamStore


class ParamSaver:
    """Saves the parameters after every change, in a thread of its own; many changes at once become one file."""

    def __init__(self, store: ParamStore, loaded: LoadedParams, path: Path, system_id: int) -> None:
        """Watch ``store`` from now on; ``loaded`` is what ``path`` held."""
        self._store = store
        self._loaded = loaded
        self._path = path
        self._system_id = system_id
        self._error: OSError | None = None
        self._changed = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None
        store.subscribe(self._on_change)

    def _on_change(self, _name: str, _value: float) -> None:
        self._changed.set()
        if self._thread is None and not self._closing:
            self._thread = threading.Thread(target=self._run, name="parameters", daemon=True)
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
            save(self._store, self._loaded, self._path, self._system_id)
        except OSError as error:
            self._error = error

    def take_error(self) -> str | None:
        """Return the sentence why the file was not written, once for each time; None if it was."""
        error, self._error = self._error, None
        return None if error is None else f"parameters are not saved: {self._path}: {error.strerror or error}"

    def flush(self) -> None:
        """Save what has changed before returning; later changes are saved too."""
        self.close()
        self._closing = False

    def close(self) -> None:
        """Save what has changed, and end; a second call does nothing."""
        self._closing = True
        if self._thread is not None:
            self._changed.set()
            self._thread.join()
            self._thread = None
