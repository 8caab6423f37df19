"""The events and status texts of a flown scenario."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gcs_cli.scenarios import flying
from gcs_cli.scenarios.flying import fly_case
from gcs_cli.scenarios.result import Wanted
from gcs_cli.scenarios.selection import find_scenarios, select

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
SCENARIO = """
plan = "{plan}"
[[event]]
at_s = 5
fault = "rotor 2 dead"
[expect]
outcome = "completed"
"""


def test_each_fact_of_a_failed_flight_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text(SCENARIO.format(plan=MISSIONS / "square.plan"))
    (case,) = select(find_scenarios([tmp_path / "broken.toml"]), None, None, None)
    result = fly_case(case, Wanted())
    texts = [text for _, text in result.texts]
    assert "Takeoff detected" in texts
    assert "takeoff" not in texts
    assert [text for text in texts if "rotor" in text.lower()] == [
        "A rotor does not follow its command: landing"
    ]
    assert "fault" in texts
    assert [time_s for time_s, _ in result.texts] == sorted(time_s for time_s, _ in result.texts)


@pytest.mark.parametrize(
    ("event", "text", "shown"),
    [
        ("failsafe_GCS_LOST", "Compass is back", True),
        ("takeoff", "Compass is back", True),
        ("item_1", "Mission item 10 reached", True),
        ("failsafe_GCS_LOST", "Manual control lost", True),
        ("failsafe_GCS_LOST", "Ground station lost: returning", False),
        ("failsafe", "Failsafe: returning (ground station lost)", False),
        ("mode_RETURN", "Ground station lost: returning", False),
        ("item_1", "Mission item 1 reached", False),
        ("landing", "Landing detected", False),
    ],
)
def test_an_event_is_left_out_only_beside_its_own_text(event: str, text: str, shown: bool) -> None:
    flight: Any = SimpleNamespace(
        log=SimpleNamespace(texts=[SimpleNamespace(time_s=10.0, text=text)]),
        events=[SimpleNamespace(time_s=10.02, name=event), SimpleNamespace(time_s=30.0, name=event)],
    )
    told = [fact for _, fact in flying.facts_of(flight)]
    assert told == [text, *([event] if shown else []), event]
