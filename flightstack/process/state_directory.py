"""The directory in which a vehicle keeps its parameters and plans over a restart: its path, lock and older files."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from flightstack.core.errors import ConfigError
from flightstack.process.log_files import RUNS
from flightstack.process.plan_file import PARAMS_NAME

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
