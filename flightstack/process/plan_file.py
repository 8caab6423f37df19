"""The file in which a process keeps the plans of its vehicle, as PX4's dataman does."""

from __future__ import annotations

import itertools
from pathlib import Path

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.plan.files import MAX_FILE_BYTES
from flightstack.plan.kept_plans import KeptPlans, plans_from_text, plans_to_text
from flightstack.process.assembly import Stack
from flightstack.process.file_saver import FileSaver

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
