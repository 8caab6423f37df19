"""The verdict, ``pil.json`` and ``pil.html`` of three flights, put together without flying."""

from __future__ import annotations

import json
from typing import Any

import pytest

from flightstack.firmware.pil.steps import BAD_INPUT, OVERRUN, REPEATED
from gcs_cli.pil.report import render_report
from gcs_cli.pil.result import COMPLETED, WALL_TIME, Flown, Outcome, closed_loop
from gcs_cli.pil.signals import SIGNALS, STAGES
from gcs_cli.pil.target_record import TargetRecord
from gcs_cli.pil.verdict import CLOSED_LOOP_ULPS, OPEN_LOOP_ULPS, Check, all_passed
from tests.support.flight_samples import changed, flight
from tests.support.parsed_page import own_part, parsed
from tests.support.pil_records import FACTS, IDENTITY, STATUS, record

ULP = 2.0**-23


def three(
    target: Any = None, same_bits: bool = True, of: TargetRecord | None = None, **outcomes: str
) -> Outcome:
    flights = {
        "MIL": changed(flight(), "torque", 5, 0, 1.0 + 7 * ULP),
        "SIL": flight(),
        "PIL": target or flight(),
    }
    facts = {"directory": "x", "sim_time_s": 1.0, "wall_time_s": 0.5, "log_sha256": "0"}
    flown = {
        stage: Flown(
            "process_ended" if stage in outcomes else COMPLETED,
            samples,
            {**facts, "directory": stage.lower()},
            outcomes.get(stage, ""),
        )
        for stage, samples in flights.items()
    }
    return closed_loop(flown, record() if of is None else of, same_bits, FACTS)


def failed(outcome: Outcome) -> list[str]:
    return [check["name"] for check in outcome.result["checks"] if not check["passed"]]


def test_equal_flights_pass_and_each_check_shows_its_margin() -> None:
    outcome = three()
    assert outcome.passed
    by_name = {check["name"]: check for check in outcome.result["checks"]}
    wrench = by_name["MIL–SIL wrench"]
    assert (wrench["measured"], wrench["limit"]) == (7.0, CLOSED_LOOP_ULPS["torque"])
    assert wrench["margin"] == CLOSED_LOOP_ULPS["torque"] / 7.0
    assert by_name["SIL–PIL wrench"]["limit"] == 0.0


def test_one_bit_on_the_target_fails_the_verdict_unless_it_is_a_board() -> None:
    target = changed(flight(), "rotor_command", 6, 2, 1.0 + ULP)
    assert failed(three(target)) == ["SIL–PIL actuators"]
    assert three(target, same_bits=False).passed


@pytest.mark.parametrize("signal", [signal.name for signal in SIGNALS])
def test_a_difference_over_its_limit_fails_whatever_the_target(signal: str) -> None:
    target = changed(flight(), signal, 6, 0, 3.0)
    names = failed(three(target, same_bits=False))
    stage = next(each.stage for each in SIGNALS if each.name == signal)
    assert names == [f"MIL–PIL {stage}", f"SIL–PIL {stage}"]


def test_every_signal_has_limits() -> None:
    assert set(CLOSED_LOOP_ULPS) == {signal.name for signal in SIGNALS}
    assert set(OPEN_LOOP_ULPS) == {signal.name for signal in SIGNALS if signal.stage != "trajectory"}


def test_a_target_that_missed_steps_or_failed_fails_the_verdict() -> None:
    assert failed(three(of=record(steps=8))) == ["steps flown without the target"]
    assert failed(three(of=record(safe_states=1))) == ["safe states of the target"]
    assert failed(three(of=record(loop_overruns=2))) == ["steps that overran their period"]


def test_overruns_are_not_judged_by_the_time_of_a_machine_with_other_programs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(IDENTITY, "cost_unit", WALL_TIME)
    assert three(of=record(loop_overruns=2)).passed


@pytest.mark.parametrize("before", [3, 2**32 - 1], ids=["some", "about to wrap"])
def test_what_a_target_counted_in_earlier_flights_is_not_held_against_this_one(
    before: int, monkeypatch
) -> None:
    for name in ("safe_states", "loop_overruns", "uart_overruns"):
        monkeypatch.setitem(STATUS, name, before)
    outcome = three()
    assert outcome.passed
    assert outcome.result["target_counters"]["uart_overruns"] == 0
    assert outcome.result["target_status_before"]["uart_overruns"] == before
    outcome = three(of=record(safe_states=1, uart_overruns=2))
    assert failed(outcome) == ["safe states of the target"]
    assert outcome.result["target_counters"]["uart_overruns"] == 2


def test_a_target_that_does_not_tell_its_counters_fails_and_the_steps_are_judged_all_the_same() -> None:
    untold = "counters that the target did not tell"
    assert failed(three(of=record(told=False))) == [untold]
    overran = record(told=False, statuses=(0, OVERRUN | REPEATED, OVERRUN))
    assert failed(three(of=overran)) == [untold, "steps that overran their period"]
    stopped = record(told=False, statuses=(BAD_INPUT,))
    assert failed(three(of=stopped)) == [untold, "safe states of the target"]
    outcome = three(
        of=record(statuses=(OVERRUN, OVERRUN), loop_overruns=1)
    )  # a report that came twice counts once
    assert [
        c["measured"] for c in outcome.result["checks"] if c["name"] == "steps that overran their period"
    ] == [2]
    page = parsed(render_report(three(of=record(told=False)).result, [], []))
    assert "they were not received at the end" in page.text


def test_a_target_without_a_record_passes_nothing() -> None:
    facts = {"directory": "x", "sim_time_s": 1.0, "wall_time_s": 0.5, "log_sha256": "0"}
    flown = {stage: Flown(COMPLETED, flight(), facts) for stage in ("MIL", "SIL", "PIL")}
    assert failed(closed_loop(flown, None, True, FACTS)) == ["steps flown without the target"]


def test_flights_that_have_no_tick_in_common_are_not_the_same() -> None:
    names = failed(three(flight(start_us=9_000_000)))
    for pair in ("MIL–PIL", "SIL–PIL"):
        assert {f"{pair} {stage}" for stage in STAGES} <= set(names)
    assert "SIL–PIL ticks of another status" in names
    assert not any(name.startswith("MIL–SIL") for name in names)


@pytest.mark.parametrize("signal", [signal.name for signal in SIGNALS])
@pytest.mark.parametrize("same_bits", [True, False])
def test_a_signal_that_is_not_there_fails_its_stage(signal: str, same_bits: bool) -> None:
    """Without its position, nobody knows whether a vehicle is in the air: nothing can be compared with MIL then."""
    target = flight()
    target = target._replace(signals={name: s for name, s in target.signals.items() if name != signal})
    outcome = three(target, same_bits)
    stage = next(each.stage for each in SIGNALS if each.name == signal)
    assert {f"MIL–PIL {stage}", f"SIL–PIL {stage}"} <= set(failed(outcome))
    about = [check["about"] for check in outcome.result["checks"] if check["name"] == f"SIL–PIL {stage}"]
    assert "no samples to compare" in about[0]
    json.dumps(outcome.result, allow_nan=False)


def test_a_flight_whose_log_cannot_be_read_fails_the_verdict() -> None:
    facts = {"directory": "x", "sim_time_s": 1.0, "wall_time_s": 0.5}
    flown = {stage: Flown(COMPLETED, flight(), facts) for stage in ("MIL", "SIL", "PIL")}
    flown["PIL"] = flown["PIL"]._replace(samples=None)
    outcome = closed_loop(flown, record(), True, FACTS)
    assert failed(outcome) == ["flights that failed"]
    assert "PIL: its log is not readable" in outcome.result["checks"][0]["about"]


def test_a_flight_that_failed_or_was_not_flown_fails_the_verdict() -> None:
    outcome = three(PIL="the target was lost")
    assert failed(outcome) == ["flights that failed"]
    assert "PIL: process_ended" in outcome.result["checks"][0]["about"]
    page = parsed(render_report(outcome.result, [], []))
    assert page.text.count("the target was lost") == 1
    only = closed_loop({"MIL": Flown("interrupted", None, {"directory": "mil"})}, None, True, FACTS)
    assert not only.passed
    assert "PIL: not flown" in only.result["checks"][0]["about"]


def test_what_is_not_a_number_passes_nothing() -> None:
    assert not Check("x", 1.0, float("nan"), "").passed
    assert not Check("x", 1.0, float("inf"), "").passed
    assert not all_passed([])


def test_pil_json_holds_everything_and_nothing_that_json_cannot() -> None:
    outcome = three(changed(flight(), "thrust", 3, 0, float("nan")))
    result = json.loads(json.dumps(outcome.result, allow_nan=False))
    assert result["verdict"] == "failed"
    assert result["format"] == "flightstack-pil-1"
    pairs = {(row["pair"], row["signal"]) for row in result["differences"]}
    assert len(pairs) == 3 * len(SIGNALS)
    assert result["profile"]["unit"] == "instructions"
    assert result["profile"]["stages"]["outer"]["count"] == 2
    assert result["stack"] == {"size": 4096, "high_water": 876}
    assert result["link"]["round_trip_p99_us"] == 300.0
    assert result["link"]["lost"] == 3
    assert result["target"]["source_hash"] == IDENTITY["source_hash"]
    assert result["flights"]["PIL"]["ticks"] == 9


def test_the_report_is_sound_html_that_needs_nothing_else() -> None:
    outcome = three()
    html = render_report(outcome.result, outcome.charts, outcome.profiles)
    page = parsed(html)
    for words in (
        "a <board>",
        "cc & co",
        "a<b.plan",
        "<hop>: MIL & PIL",
        "876 of 4096 octets",
        "same bits",
        "passed",
    ):
        assert words in page.text, words
    assert not {"img", "link", "iframe"} & set(page.tags)
    assert "http" not in own_part(html)
    assert "cost-of-a-step" in page.charts
    assert "Not drawn, because no bit differs: MIL–SIL" in page.text
    assert [value for name, value in page.attributes if name == "href"] == [
        "mil/report.html", "sil/report.html", "pil/report.html",
    ]  # fmt: skip
    assert "[instructions]" in page.text
    assert "target: uart overruns0" in page.text  # those before the flight are not this flight's
    assert "ready, up for 90.0 s; steps 2, uart overruns 77" in page.text
    assert "no time" in page.text  # instructions are no time


def test_the_report_of_a_failed_run_says_so() -> None:
    outcome = three(changed(flight(), "torque", 4, 1, 2.0), PIL="the target was lost")
    page = parsed(render_report(outcome.result, outcome.charts, outcome.profiles))
    assert ("class", "outcome bad") in page.attributes
    assert "the target was lost" in page.text
    facts = {"directory": "mil", "sim_time_s": None, "wall_time_s": None}
    only = closed_loop({"MIL": Flown("interrupted", None, facts)}, None, True, FACTS)
    parsed(render_report(only.result, only.charts, only.profiles))
