"""Scenario files as tests: one for each seed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from flightstack.core.errors import ConfigError
from flightstack.testing.artifacts import Evidence, description
from flightstack.testing.scenario import is_scenario, load_scenario
from flightstack.testing.scenario_run import run_scenario


class ScenarioFailedError(AssertionError):
    """A flight did not meet the expectations of its scenario."""


class ScenarioFile(pytest.File):
    """A scenario file."""

    @classmethod
    def of(cls, path: Path, parent: pytest.Collector) -> ScenarioFile | None:
        """Return the collector of ``path``, or None if it is no scenario file."""
        return cls.from_parent(parent, path=path) if is_scenario(path) else None

    def collect(self) -> Iterator[ScenarioItem]:
        """Yield a test for each seed; an error in the file is an error of collection."""
        try:
            scenario = load_scenario(self.path)
        except ConfigError as error:
            raise self.CollectError(str(error)) from None
        for seed in scenario.seeds:
            yield ScenarioItem.from_parent(self, name=f"seed={seed}", scenario=scenario, seed=seed)


class ScenarioItem(pytest.Item):
    """The flight of a scenario with one seed."""

    def __init__(self, *, scenario: Any, seed: int, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._scenario = scenario
        self._seed = seed
        self.flightstack_evidence: Evidence | None = None
        """The flight, once it was flown."""

    def runtest(self) -> None:
        """Fly, and raise ScenarioFailedError with all expectations that do not hold."""
        verdict = run_scenario(self._scenario, self._seed)
        if not verdict.passed:
            flight = verdict.flight
            lines = description(str(flight), flight.texts, flight.setup)
            self.flightstack_evidence = Evidence(flight, b"", [*lines, f"fly:     {verdict.command}"])
            raise ScenarioFailedError("\n".join(verdict.failures))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the expectations that do not hold, without a traceback."""
        if isinstance(excinfo.value, (ScenarioFailedError, ConfigError)):
            return f"{self._scenario.name}, seed {self._seed}: {excinfo.value}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return where the test is, and its name."""
        return self.path, None, f"{self._scenario.name}, seed {self._seed}"
