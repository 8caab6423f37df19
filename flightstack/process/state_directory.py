"""The state directory of a vehicle: its lock, and the parameters and plans saved there for the next start."""

from __future__ import annotations

import fcntl
import itertools
import os
import threading
from collections.abc import Callable
from pathlib import Path

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.plan.files import MAX_FILE_BYTES
from flightstack.plan.kept_plans import KeptPlans, plans_from_text, plans_to_text
from flightstack.process.assembly import Stack
from flightstack.process.log_files import RUNS

LOCK_NAME, PLANS_NAME, PARAMS_NAME = "lock", "plans.json", "vehicle.params"
"""Files of a state directory."""


class StateDirectory:
    """State directory of one vehicle: ``path``, or by default that of ``instance`` under ``runs``."""

    def __init__(self, path: Path | None, instance: int, has_params: bool = True) -> None:
        """Without ``has_params``, parameters are saved elsewhere and an older file is not moved."""
        self.is_named = path is not None
        self.path = RUNS / f"state-{instance}" if path is None else path
        adopts = has_params and not self.is_named
        self._old_params = RUNS / f"params-{instance}.params" if adopts else None
        self._lock: int | None = None

    @property
    def params(self) -> Path:
        """The parameter file, at its older path until ``open`` moves it."""
        old, new = self._old_params, self.path / PARAMS_NAME
        return old if old is not None and not new.exists() and old.is_file() else new

    def open(self) -> str | None:
        """Create and lock the directory and move an older parameter file there; return a notice of the move, or None.

        Raise ConfigError if another process holds the lock or a named directory is not writable. The lock lasts until
        the process ends. Errors of the default directory are reported when saving.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            if not self.is_named:
                return None
            raise ConfigError("--state-dir", str(self.path), f"cannot be created: {error.strerror}") from None
        if self.is_named and not os.access(self.path, os.W_OK | os.X_OK):
            raise ConfigError("--state-dir", str(self.path), "is not writable: permission denied")
        self._take_lock()
        return self._adopt_params()

    def _take_lock(self) -> None:
        try:
            self._lock = os.open(self.path / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            reason = "is in use by another vehicle: give each its own --instance or --state-dir DIR"
            raise ConfigError("--state-dir", str(self.path), reason) from None
        except OSError:  # no support for locks, or not writable
            self.close()

    def _adopt_params(self) -> str | None:
        old, new = self.params, self.path / PARAMS_NAME
        if old == new:
            return None
        try:
            old.rename(new)
        except OSError as error:
            raise ConfigError(old, "", f"cannot be moved to {new}: {error.strerror}") from None
        return f"{old} was moved to {new}"

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


class FileSaver:
    """Writes a file after changes in its own thread, so that the loops do not wait for the disk.

    ``write`` writes the newest state in that thread. Messages about its errors begin with ``failure``; the next change
    is written again.
    """

    def __init__(self, write: Callable[[], None], failure: str) -> None:
        self._write = write
        self._failure = failure
        self._error: Exception | None = None
        self._unreported: Exception | None = None
        self._changed = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None

    def change(self) -> None:
        """Request a write."""
        self._changed.set()
        if self._thread is None and not self._closing:
            self._thread = threading.Thread(target=self._run, name="saver", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        while True:
            self._changed.wait()
            closing = self._closing  # read before clearing: no change follows it
            self._changed.clear()
            self.save()
            if closing:
                return

    def save(self) -> None:
        """Write the file in this thread; store an error for ``take_error`` and ``problem``."""
        try:
            self._write()
        except Exception as error:  # the thread must survive for later changes
            if self._error is None:
                self._unreported = error
            self._error = error
        else:
            self._error = None

    def problem(self) -> str | None:
        """Return why the newest state is not saved, or None if it is."""
        return self._sentence(self._error)

    def _sentence(self, error: Exception | None) -> str | None:
        if error is None:
            return None
        reason = error.strerror if isinstance(error, OSError) else str(error)
        if not isinstance(error, OSError | ConfigError):
            reason = f"{type(error).__name__}: {error}"
        return f"{self._failure}: {reason or error}"

    def take_error(self) -> str | None:
        """Return a new error message and clear it, or None; one per series of failures."""
        error, self._unreported = self._unreported, None
        return self._sentence(error)

    def flush(self) -> None:
        """Write changes before returning; later changes are written too."""
        self.close()
        self._closing = False

    def close(self) -> None:
        """Write changes and stop the thread; a second call does nothing."""
        self._closing = True
        if self._thread is not None:
            self._changed.set()
            self._thread.join()
            self._thread = None


_NO_PLANS = ((0, 0, 0), 0, False, None)


class PlanFile:
    """Restores the plans of the previous run and saves changes."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._plans = KeptPlans()
        self._saved_key: object = _NO_PLANS
        self._may_write = True
        self._saver = FileSaver(self._write, f"the plans are not saved to {path}")

    def restore(self, stack: Stack) -> str | None:
        """Activate the saved plans; return an error message, or None.

        A file that is unreadable or whose plans are refused is renamed and not overwritten.
        """
        if not self._path.exists():
            return None
        try:
            refusal = stack.ground.restore_plans(plans_from_text(_read(self._path), self._path))
        except ConfigError as error:
            refusal = str(error)
        if refusal is None:
            self._saved_key = _key(stack)
            return None
        return f"plans not restored: {refusal}; {self._rename_refused()}"

    def watch(self, stack: Stack) -> None:
        """Save the plans if they have changed since the last call."""
        key = _key(stack)
        if key != self._saved_key and self._may_write:
            self._saved_key, self._plans = key, stack.ground.plans()
            self._saver.change()

    def take_error(self) -> str | None:
        """Return a new message why plans were not saved, or None."""
        return self._saver.take_error()

    def close(self) -> None:
        """Save changes and stop."""
        self._saver.close()

    def _write(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_text_atomically(self._path, plans_to_text(self._plans))

    def _rename_refused(self) -> str:
        """Rename the file; return a message about the outcome."""
        stem, suffix = self._path.stem, self._path.suffix
        names = (f"{stem}.refused{'' if n == 1 else f'-{n}'}{suffix}" for n in itertools.count(1))
        aside = next(path for name in names if not (path := self._path.with_name(name)).exists())
        try:
            self._path.rename(aside)
        except OSError as error:
            self._may_write = False
            return f"it cannot be renamed ({error.strerror}), so no plan is saved"
        return f"the file is now {aside}"


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
        if len(data) > MAX_FILE_BYTES:
            raise ConfigError(path, "", "is too large")
        return data.decode("utf-8")
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(path, "", "is damaged: it is not text") from error


def _key(stack: Stack) -> object:
    """Return a key that changes with the plans."""
    places, progress = stack.places, stack.now.progress
    home = places.home_point if places.home_is_chosen else None
    return places.ids, progress.current, progress.finished, home
