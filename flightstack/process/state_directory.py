"""The directory in which a vehicle keeps its parameters and plans over a restart: its path, lock and older files."""

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

LOCK_NAME = "lock"


class StateDirectory:
    """The directory ``path`` of one vehicle; without a path, that of ``instance`` under ``runs``."""

    def __init__(self, path: Path | None, instance: int, has_params: bool = True) -> None:
        """Without ``has_params`` the parameters are elsewhere, and no older file is adopted."""
        self.is_named = path is not None
        self.path = RUNS / f"state-{instance}" if path is None else path
        adopts = has_params and not self.is_named
        self._old_params = RUNS / f"params-{instance}.params" if adopts else None
        self._lock: int | None = None

    @property
    def params(self) -> Path:
        """The parameter file: that of an earlier version until it is adopted."""
        old, new = self._old_params, self.path / PARAMS_NAME
        return old if old is not None and not new.exists() and old.is_file() else new

    def open(self) -> str | None:
        """Create and lock the directory and adopt an older parameter file; return a sentence about that file, or None.

        Raise ConfigError if another process has the lock, or if nothing can be kept in a named directory. The lock
        lasts until the process ends. Without a name the vehicle flies all the same, and saving reports the error.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            if not self.is_named:
                return None
            raise ConfigError("--state", str(self.path), f"cannot be made: {error.strerror}") from None
        if self.is_named and not os.access(self.path, os.W_OK | os.X_OK):
            raise ConfigError("--state", str(self.path), "nothing can be written there: permission denied")
        self._take_lock()
        return self._adopt_params()

    def _take_lock(self) -> None:
        try:
            self._lock = os.open(self.path / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            reason = "another vehicle keeps its state there: give each its own --instance or --state DIR"
            raise ConfigError("--state", str(self.path), reason) from None
        except OSError:  # some file systems have no locks, and a directory that cannot be written needs none
            self.close()

    def _adopt_params(self) -> str | None:
        old, new = self.params, self.path / PARAMS_NAME
        if old == new:
            return None
        try:
            old.rename(new)
        except OSError as error:
            raise ConfigError(old, "", f"cannot be moved to {new}: {error.strerror}") from None
        return f"{old} was moved to {new}, where parameters are saved now"

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


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


PLANS_NAME, PARAMS_NAME = "plans.json", "vehicle.params"
"""Files of a state directory."""
_NOTHING = ((0, 0, 0), 0, False, None)


class PlanFile:
    """Restores the plans of the process before this one, and saves every change."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._plans = KeptPlans()
        self._saved_key: object = _NOTHING
        self._may_write = True
        self._saver = FileSaver(self._write, f"the plans are not saved to {path}")

    def restore(self, stack: Stack) -> str | None:
        """Put the kept plans in force; return the sentence why not all of them are, or None.

        A file that cannot be read gives no plan at all. It is put aside, like one whose plans are refused: what a
        user gave is not overwritten.
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
        return f"plans not restored: {refusal}; {self._put_aside()}"

    def watch(self, stack: Stack) -> None:
        """Save the plans if they have changed since the last call."""
        key = _key(stack)
        if key != self._saved_key and self._may_write:
            self._saved_key, self._plans = key, stack.ground.plans()
            self._saver.change()

    def take_error(self) -> str | None:
        """Return the sentence why the plans were not saved, or None."""
        return self._saver.take_error()

    def close(self) -> None:
        """Save what has changed, and end."""
        self._saver.close()

    def _write(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_text_atomically(self._path, plans_to_text(self._plans))

    def _put_aside(self) -> str:
        """Give the file another name; return what became of it."""
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
    """Return what differs whenever the plans do."""
    places, progress = stack.places, stack.now.progress
    home = places.home_point if places.home_is_chosen else None
    return places.ids, progress.current, progress.finished, home
