"""Find scenarios whose files changed, by the times of the files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gcs_cli.scenarios.selection import Case

Stamp = tuple[int, int] | None
"""Time of change [ns] and size; None without the file."""


def stamp(path: Path) -> Stamp:
    """Return the stamp of a file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


class Stamps:
    """The files of a set of cases as they were seen last."""

    def __init__(self) -> None:
        self._flown: dict[Path, Stamp] = {}
        self._polled: dict[Path, Stamp] = {}

    @property
    def count(self) -> int:
        """The number of files."""
        return len(self._flown)

    def changed(self, cases: Sequence[Case]) -> list[Case]:
        """Return the cases of which a file is new or changed since the last call, and remember the files."""
        files = {case.scenario.path: case.scenario.files() for case in cases}
        before, self._flown = self._flown, {path: stamp(path) for paths in files.values() for path in paths}
        self._polled = dict(self._flown)
        stale = {path for path, found in self._flown.items() if path not in before or before[path] != found}
        return [case for case in cases if stale.intersection(files[case.scenario.path])]

    def poll(self, scenarios: Sequence[Path]) -> bool:
        """Return True if a file changed since the last poll or ``changed``, or if there is a new scenario."""
        now = {path: stamp(path) for path in (*self._flown, *scenarios)}
        before, self._polled = self._polled, now
        return now != before
