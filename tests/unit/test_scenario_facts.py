"""The events and status texts of a flown scenario."""

from __future__ import annotations

from pathlib import Path

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
