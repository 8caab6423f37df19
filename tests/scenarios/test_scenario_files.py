"""Every scenario file of ``tests/scenarios/files`` is flown and judged by its own expectations."""

from __future__ import annotations

from pathlib import Path

import pytest

from flightstack.testing import load_scenario, run_scenario
from tests.support.tools import NIGHTLY

FOLDER = Path(__file__).parent / "files"
LONG = ("loop_30_min",)
"""Scenarios of half a minute of CPU time, flown with NIGHTLY=1 only."""
FILES = [path for path in sorted(FOLDER.glob("*/*.toml")) if NIGHTLY or path.stem not in LONG]


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_scenario_file(path: Path) -> None:
    scenario = load_scenario(path)
    for seed in scenario.seeds:
        verdict = run_scenario(scenario, seed)
        assert verdict.passed, "\n".join([*verdict.failures, verdict.command])
