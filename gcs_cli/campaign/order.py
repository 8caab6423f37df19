"""A flight with all that a machine needs for it which has nothing but an installation of flightstack."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from flightstack.core.atomic_file import write_bytes_atomically
from flightstack.testing.scenario import Scenario
from gcs_cli.campaign.installed import digests
from gcs_cli.scenarios.result import Result, Wanted
from gcs_cli.scenarios.selection import Case


class Order(NamedTuple):
    """A case with the files of its scenario.

    At another machine a directory, ``root``, stands for the client's file system: the client's working directory is
    there at its path below ``root``, so that relative paths lead to the copies.
    """

    case: Case
    wanted: Wanted
    files: Mapping[str, bytes]
    """Content of the scenario's own files by their absolute paths."""
    installed: Mapping[str, str]
    """Digests of the files that come with the installation, by name."""

    def place(self, root: Path) -> Case:
        """Write the files that are not there yet, and return the case with absolute paths below ``root``.

        Raise OSError.
        """
        for name, content in self.files.items():
            copy = below(root, name)
            if not copy.exists():
                copy.parent.mkdir(parents=True, exist_ok=True)
                write_bytes_atomically(copy, content, survives_power_loss=False)
        return replace(self.case, scenario=_placed(self.case.scenario, root))


class Files:
    """The files of scenarios, each read at its first use: another machine writes it once."""

    def __init__(self) -> None:
        self._contents: dict[Path, bytes] = {}
        self._known: dict[tuple[str | None, ...], tuple[Mapping[str, bytes], Mapping[str, str]]] = {}

    def order(self, case: Case, wanted: Wanted) -> Order:
        """Return the order for a case; raise OSError."""
        scenario = case.scenario
        uploads = (event.upload for event in scenario.event)
        key = (
            scenario.plan,
            scenario.vehicle,
            scenario.gains,
            scenario.controller,
            str(scenario.path),
            *uploads,
        )
        if key not in self._known:
            own = {str(path.absolute()): self._content(path.absolute()) for path in scenario.own_files()}
            self._known[key] = own, digests(scenario.installed_files())
        return Order(case, wanted, *self._known[key])

    def _content(self, path: Path) -> bytes:
        if path not in self._contents:
            self._contents[path] = path.read_bytes()
        return self._contents[path]


def below(root: Path, path: str) -> Path:
    """Return the place of an absolute path of the client, which is never outside ``root``."""
    return root / os.path.normpath(f"/{path}").lstrip("/")


def without_root(result: Result, root: Path) -> Result:
    """Return a result as the client's machine gives it: the text of an error may name a file below ``root``."""
    if result.outcome != "error":
        return result
    checks = tuple(replace(check, found=check.found.replace(str(root), "")) for check in result.checks)
    return replace(result, checks=checks, outcome_text=result.outcome_text.replace(str(root), ""))


def _placed(scenario: Scenario, root: Path) -> Scenario:
    def placed(name: str) -> str:
        return str(below(root, name)) if name.startswith("/") else name

    return replace(
        scenario,
        path=Path(placed(str(scenario.path))),
        plan=None if scenario.plan is None else placed(scenario.plan),
        vehicle=placed(scenario.vehicle),
        gains=placed(scenario.gains),
        event=tuple(
            event if event.upload is None else replace(event, upload=placed(event.upload))
            for event in scenario.event
        ),
    )
