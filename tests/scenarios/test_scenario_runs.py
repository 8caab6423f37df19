"""Scenarios are flown and judged: events, requests, each expectation passing and failing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import pytest

from flightstack.testing import Verdict, load_scenario, run_scenario
from flightstack.testing.artifacts import run_info
from flightstack.testing.expectations import Check, evaluate
from flightstack.testing.scenario import Expect
from gcs_cli.scenarios.flying import fly_case
from gcs_cli.scenarios.result import Wanted
from gcs_cli.scenarios.selection import select

MISSIONS = Path(__file__).parents[2] / "missions"
HOP = "plan = 'hop'\nstate = 'truth'\n"
"""Up to 0.7 m and down, 4 s."""
SQUARE = "plan = 'square'\nstate = 'truth'\n"


def flown(folder: Path, text: str, seed: int | None = None) -> Verdict:
    path = folder / "a.toml"
    path.write_text(text, encoding="utf-8")
    return run_scenario(load_scenario(path), seed)


@pytest.fixture(scope="module")
def square(tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    events = "event = [{at_s = 1.0, link = 'cut', for_s = 1}]\n"
    return flown(tmp_path_factory.mktemp("square"), SQUARE + events)


def check_of(square: Verdict, **expected: object) -> Check:
    """Evaluate the square by one expectation besides its outcome."""
    expect = replace(Expect(outcome="any"), **expected)  # type: ignore[arg-type]
    checks = evaluate(expect, square.flight, square.last, square.flight.caused)
    assert checks[0].passed or "outcome" in expected or "refusal" in expected
    return checks[-1]


EXPECTATIONS: list[tuple[dict[str, object], dict[str, object], str]] = [
    ({"outcome": "completed"}, {"outcome": "failsafe"}, "outcome failsafe: completed: the mission was flown"),
    ({"outcome": "MISSION"}, {"outcome": "RETURN"}, "outcome RETURN: it landed in mode MISSION"),
    ({}, {"outcome": "GCS_LOST"}, "outcome GCS_LOST: active failsafes: none"),
    ({}, {"refusal": "no home"}, "refused: no home: the mission was flown to its end"),
    ({"reached": (0, 1, 2, 3, 4, 5)}, {"reached": (0, 2)}, "reached = [0, 2]: [0, 1, 2, 3, 4, 5]"),
    ({"corridor_m": 1.0}, {"corridor_m": 0.001}, "corridor_m ≤ 0.001: "),
    ({"max_error_m": 1.0}, {"max_error_m": 0.001}, "max_error_m ≤ 0.001: "),
    ({"rms_error_m": 1.0}, {"rms_error_m": 1e-4}, "rms_error_m ≤ 0.0001: "),
    ({"landing_error_m": 1.0}, {"landing_error_m": 1e-9}, "landing_error_m ≤ 1e-09: "),
    ({"duration_s": (20.0, 30.0)}, {"duration_s": (8.0, 9.0)}, "duration_s 8 to 9: 2"),
    (
        {"always": ("altitude_m < 6",)},
        {"always": ("altitude_m < 1",)},
        "always altitude_m < 1: violated at t = ",
    ),
    (
        {"eventually": ("altitude_m > 1.5 within 3 s of takeoff",)},
        {"eventually": ("altitude_m > 9",)},
        "eventually altitude_m > 9: violated at t = ",
    ),
    ({}, {"always": ("armed after power_cycle",)}, "did not happen in this flight; its events are "),
    ({"at_end": ("not armed",)}, {"at_end": ("armed",)}, "at end armed: t = "),
    ({"no_text_above": "warning"}, {"no_text_above": "debug"}, "no text above debug: t = "),
    ({"texts": ("Landing detected",)}, {"texts": ("Rotor",)}, "text 'Rotor': Armed; "),
]


def test_every_expectation_is_tested() -> None:
    tested = {name for _, bad, _ in EXPECTATIONS for name in bad}
    assert tested == {field.name for field in fields(Expect)}


@pytest.mark.parametrize(("good", "bad", "words"), EXPECTATIONS, ids=lambda value: str(value)[:40])
def test_an_expectation_passes_and_fails(
    square: Verdict, good: dict[str, object], bad: dict[str, object], words: str
) -> None:
    assert check_of(square, **good).passed
    failed = check_of(square, **bad)
    assert not failed.passed
    assert words in str(failed)


@pytest.mark.parametrize(
    "limit", [{"max_error_m": 0.001}, {"corridor_m": 0.001}, {"always": ("altitude_m < 1",)}], ids=str
)
def test_a_failed_limit_shows_when_and_the_values_around(square: Verdict, limit: dict[str, object]) -> None:
    first, *around = check_of(square, **limit).found.splitlines()
    assert "at t = " in first
    assert sum(line.startswith("> t = ") for line in around) == 1
    assert all("altitude_m = " in line for line in around)
    assert len(around) >= 4


def test_margins_count_in_the_unit_of_the_limit(square: Verdict) -> None:
    check = check_of(square, max_error_m=0.5)
    assert check.margin == pytest.approx(0.5 - square.flight.max_error_m)
    assert check.share == pytest.approx(check.margin / 0.5)
    assert check_of(square, at_end=("not armed",)).share is None


def names(events: Sequence[object]) -> list[str]:
    return [event.name for event in events]  # type: ignore[attr-defined]


def test_an_event_happens_once_and_ends_after_its_time(square: Verdict) -> None:
    assert names(square.flight.caused) == ["link_cut", "link_cut_end"]
    begin_s, end_s = (event.time_s for event in square.flight.caused)
    assert begin_s == pytest.approx(1.0, abs=0.02)  # one outer tick of 0.01 s
    assert end_s - begin_s == pytest.approx(1.0, abs=0.02)


def test_events_follow_items_conditions_and_other_events(tmp_path: Path) -> None:
    events = """
    [[event]]
    when = "altitude_m > 0.5"
    fault = "rotor:1:weak=0.99"
    [[event]]
    after = "fault"
    delay_s = 0.5
    link = "to_vehicle delay 0.1"
    [[event]]
    at_item = 1
    param = "MIS_TAKEOFF_ALT = 3"
    """
    verdict = flown(tmp_path, HOP + events)
    assert verdict.passed, verdict.failures
    fault, delay = verdict.flight.caused
    assert (fault.name, delay.name) == ("fault", "link_delay")
    assert verdict.flight.at(fault.time_s).altitude_m == pytest.approx(0.5, abs=0.05)
    assert delay.time_s - fault.time_s == pytest.approx(0.5, abs=0.02)


def test_orders_fly_without_a_plan(tmp_path: Path) -> None:
    text = """
    duration_s = 20
    event = [
      {at_s = 0.5, command = "takeoff 3"},
      {at_s = 0.6, command = "arm"},
      {when = "altitude_m > 2.8", command = "goto 4 3"},
      {when = "north_m > 3.9 and east_m > 2.9", command = "hold"},
      {at_s = 9, command = "mode LAND"},
    ]
    [expect]
    eventually = ["mode == 'TAKEOFF'", "north_m > 3.9 and east_m > 2.9"]
    at_end = ["landed", "hypot(north_m - 4, east_m - 3) < 0.5"]
    """
    verdict = flown(tmp_path, text)
    assert verdict.passed, verdict.failures


def test_a_refusal_that_is_expected_passes_and_another_fails(tmp_path: Path) -> None:
    event = "event = [{{when = 'altitude_m > 0.5', command = 'disarm', refused = '{reason}'}}]\n"
    assert flown(tmp_path, HOP + event.format(reason="air")).passed
    (failure,) = flown(tmp_path, HOP + event.format(reason="battery")).failures
    assert "unexpected reason" in failure
    assert "expected 'battery'" in failure
    granted = "event = [{at_s = 0.5, command = 'speed 2', refused = 'no'}]\n"
    (failure,) = flown(tmp_path, HOP + granted).failures
    assert "not refused: speed 2" in failure


def test_a_refused_request_without_an_expectation_fails(tmp_path: Path) -> None:
    (failure,) = flown(tmp_path, HOP + "event = [{when = 'altitude_m > 0.5', command = 'disarm'}]\n").failures
    assert "unexpected refusal: disarm refused" in failure


def test_an_event_that_does_not_happen_is_a_failure(tmp_path: Path) -> None:
    events = "event = [{when = 'altitude_m > 50', link = 'cut'}, {at_s = 1, delay_s = 99, link = 'cut'}]\n"
    assert flown(tmp_path, HOP + events).failures == [
        "event[0]: did not happen in this flight",
        "event[1]: did not happen in this flight",
    ]


def test_equal_seeds_fly_equally_and_other_seeds_do_not(tmp_path: Path) -> None:
    gusts = "vehicle = 'x_quad'\nwind = {gust_m_s = 1}\nseed = 3\nrepeat = 2\n"
    path = tmp_path / "a.toml"
    path.write_text(HOP + gusts)
    third, fourth = select([path])
    wanted = Wanted()
    hashes = [fly_case(case, wanted).log_sha256 for case in (third, fourth, third)]
    assert hashes[0] == hashes[2] != hashes[1]


def test_a_failed_flight_brings_its_log_and_report(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(HOP + "expect = {max_error_m = 0.0001}\n")
    (case,) = select([path])
    result = fly_case(case, Wanted(figures=True, files=True))
    assert result.log.startswith(b"ULog")
    assert "<title>a: flight report</title>" in result.report
    assert [figure.name for figure in result.figures] == ["map", "height"]
    assert max(len(series.x) for figure in result.figures for series in figure.panels[0].series) <= 400


def test_an_error_in_flight_is_a_failure_with_its_sentence(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(HOP + "event = [{at_s = 1, upload = 'square'}]\n")
    (case,) = select([path])
    scenario = replace(case.scenario, client=(*case.scenario.client,) * 1, plan="gone.plan")
    result = fly_case(replace(case, scenario=scenario), Wanted())
    assert not result.passed
    assert "gone.plan: cannot be read" in result.failures[0].found


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_scenarios_of_the_project_pass(path: Path) -> None:
    for case in select([path]):
        result = fly_case(case, Wanted())
        assert result.passed, result.failures


ASKED_IN_EACH_TICK = "{when = 'altitude_m > 1000', fault = 'battery:level=0.5'}"
"""An event that never happens, and for which all events are asked after every outer tick."""
CHAINS = {
    "a mode of a command": "{at_s = 10, command = 'land'}, {when = \"mode == 'LAND'\", fault = 'rotor:1:weak=0.9'}",
    "an item of a command": "{at_s = 7, command = 'mav_cmd 224 3'}, {at_item = 3, fault = 'rotor:1:weak=0.9'}",
    "modes one after another": (
        "{at_s = 10, command = 'mode HOLD'}, {when = \"mode == 'HOLD'\", delay_s = 0.3, command = 'rtl'}, "
        "{when = \"mode == 'RETURN'\", delay_s = 0.05, fault = 'rotor:1:weak=0.9'}"
    ),
    "the end of another": (
        "{at_s = 8.003, delay_s = 0.5, link = 'cut', for_s = 1}, {after = 'link_cut', fault = 'rotor:1:weak=0.9'}, "
        "{after = 'link_cut_end', delay_s = 0.1, fault = 'rotor:2:weak=0.9'}"
    ),
    "an item": "{at_item = 2, link = 'cut', for_s = 1}, {after = 'link_cut', fault = 'rotor:1:weak=0.9'}",
}


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS.keys())
def test_events_happen_at_the_times_of_events_that_are_asked_in_each_tick(chain: str, tmp_path: Path) -> None:
    start = SQUARE + "[expect]\noutcome = 'any'\n"
    few, many = (
        flown(tmp_path, start.replace("[expect]", f"event = [{events}]\n[expect]"))
        for events in (chain, f"{chain}, {ASKED_IN_EACH_TICK}")
    )
    assert few.flight.caused
    assert few.flight.events == many.flight.events
    assert few.flight.caused == many.flight.caused


def test_the_report_of_a_scenario_says_when_it_had_a_fault(tmp_path: Path) -> None:
    flight = flown(tmp_path, HOP + "event = [{at_s = 2.0, fault = 'battery:level=0.5'}]\n").flight
    (fault,) = flight.caused
    assert run_info(flight, "a", "", tmp_path / "a.ulg").faults == (f"at {fault.time_s:.2f} s",)
