"""The results of ``gcs test``: JSON, JUnit XML, the page, and the lines of the terminal."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from rich.console import Console

from flightstack.testing.expectations import Check
from flightstack.testing.scenario import Scenario
from gcs_cli.charts.figure import Axis, Figure, Panel, Series
from gcs_cli.scenarios.display import make_display, print_failures, print_summary
from gcs_cli.scenarios.junit import junit_xml
from gcs_cli.scenarios.page import render_results
from gcs_cli.scenarios.result import Result, Row, as_json, margin_text, not_flown
from gcs_cli.scenarios.selection import Case
from tests.support.parsed_page import own_part, parsed

GOOD = Check("max_error_m ≤ 0.5", True, "0.375 m", 0.125, 0.5)
BAD = Check(
    "always altitude_m < 4", False, "violated at t = 3.00 s\n> t = 3.00 s: altitude_m = 4.5", -0.5, 4.0
)
FREE = Check("outcome completed", True, "completed")


def case(label: str, seed: int = 1) -> Case:
    scenario = Scenario(path=Path(f"missions/{label}.toml"), description=f"About {label} & <more>.")
    return Case(scenario, seed, label, f"gcs test missions/{label}.toml --seed {seed} --repeat 1")


def figure(name: str) -> Figure:
    curve = Series("flown", np.arange(3.0), np.arange(3.0))
    return Figure(name, name.title(), [Panel(Axis("height", "m"), [curve])])


def row(label: str, *checks: Check, seed: int = 1, kept: str | None = None) -> Row:
    closest = next((check for check in checks if check.share is not None), None)
    result = Result(
        checks,
        closest,
        "completed",
        "the mission was flown",
        25.0,
        1.5,
        "ab",
        ((0.4, "takeoff"),),
        (figure("map"),),
    )
    return Row(case(label, seed), result, kept)


ROWS = [row("calm", GOOD, FREE), row("gusts", BAD, FREE, seed=3, kept="runs/x"), row("hop", FREE)]


def test_margins_are_shown_with_their_share() -> None:
    assert margin_text(GOOD) == "max_error_m ≤ 0.5: margin 0.125 (25 %)"
    assert margin_text(BAD) == "always altitude_m < 4: exceeded by 0.5"
    assert margin_text(FREE) == margin_text(None) == ""


def test_the_document_has_every_flight_in_order() -> None:
    document = as_json(ROWS, 3.0, False)
    assert (document["passed"], document["failed"], document["interrupted"]) == (2, 1, False)
    assert [(each["scenario"], each["seed"], each["passed"]) for each in document["flights"]] == [
        ("calm", 1, True), ("gusts", 3, False), ("hop", 1, True),
    ]  # fmt: skip
    assert document["flights"][1]["checks"][0]["margin"] == -0.5
    assert document["flights"][1]["kept"] == "runs/x"
    assert document["flights"][2]["closest"] is None
    json.dumps(document, allow_nan=False)


def test_infinite_margins_are_null_in_the_document() -> None:
    check = Check("eventually landed", True, "holds at t = 1.00 s", float("inf"), 1.0)
    document = as_json([Row(case("a"), Result((check,)))], 1.0, False)
    assert document["flights"][0]["checks"][0]["margin"] is None
    json.dumps(document, allow_nan=False)


def test_junit_has_a_test_case_for_each_flight() -> None:
    root = ElementTree.fromstring(junit_xml(ROWS, 3.0))
    assert root.tag == "testsuites"
    assert {name: root.get(name) for name in ("tests", "failures", "errors", "time")} == {
        "tests": "3", "failures": "1", "errors": "0", "time": "3.000",
    }  # fmt: skip
    tests = root.findall("testsuite/testcase")
    assert [(test.get("classname"), test.get("name"), test.get("time")) for test in tests] == [
        ("missions", "calm[seed 1]", "1.500"),
        ("missions", "gusts[seed 3]", "1.500"),
        ("missions", "hop[seed 1]", "1.500"),
    ]
    properties = {each.get("name"): each.get("value") for each in tests[1].findall("properties/property")}
    assert properties == {
        "seed": "3",
        "margin": "always altitude_m < 4: exceeded by 0.5",
        "command": "gcs test missions/gusts.toml --seed 3 --repeat 1",
        "kept": "runs/x",
    }
    failure = tests[1].find("failure")
    assert failure is not None
    assert failure.get("message") == "always altitude_m < 4: violated at t = 3.00 s"
    assert failure.text is not None
    assert "> t = 3.00 s: altitude_m = 4.5" in failure.text
    assert tests[0].find("failure") is None


def test_junit_replaces_characters_that_xml_cannot_hold() -> None:
    bad = Row(case("a"), Result((Check("text", False, "odd \x00\x1b\ud800 text"),)))
    root = ElementTree.fromstring(junit_xml([bad], 1.0))
    failure = root.find("testsuite/testcase/failure")
    assert failure is not None
    assert failure.get("message") == "text: odd ??? text"


def test_the_page_shows_failed_flights_first_and_open() -> None:
    html = render_results(ROWS, 3.0)
    page = parsed(own_part(html))
    assert html.count("plotly.js v") == parsed_count(html)
    summaries = [value for name, value in page.attributes if name == "data-name"]
    assert summaries == ["gusts", "calm", "hop"]
    assert sum(name == "open" for name, _ in page.attributes) == 1
    for words in (
        "1 failed",
        "About gusts & <more>.",
        "violated at t = 3.00 s",
        "altitude_m = 4.5",
        "25 %",
        "runs/x",
    ):
        assert words in page.text, words
    for each in ROWS:
        assert each.case.command in page.text
    assert sorted(page.charts) == ["map-calm-seed1", "map-gusts-seed3", "map-hop-seed1"]


def parsed_count(html: str) -> int:
    """Return how often plotly.js names itself when it is there once."""
    (start,) = [at for at in range(len(html)) if html.startswith("<script>/**", at)]
    return html[start : html.index("</script>", start)].count("plotly.js v")


def test_the_page_of_many_flights_grows_by_little_each() -> None:
    few, many = (
        len(render_results([row("a", GOOD, seed=n) for n in range(count)], 1.0)) for count in (1, 101)
    )
    assert (many - few) / 100 < 10_000  # 3.4 kB with one chart of three samples


def test_an_interrupted_run_is_named_on_the_page() -> None:
    assert "interrupted" in parsed(own_part(render_results(ROWS, 3.0, interrupted=True))).text


def printed(rows: list[Row], width: int = 200, **terminal: bool) -> str:
    console = Console(file=io.StringIO(), width=width, highlight=False, **terminal)  # type: ignore[arg-type]
    display = make_display(console, [each.case for each in rows])
    for each in rows:
        display.start(each.case)
        display.tick()
        display.end(each.case)
        display.finish(each.case, each.result)
    display.note("a note")
    display.close()
    print_failures(console, rows)
    print_summary(console, rows, 2, 3.0)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_without_a_terminal_each_flight_is_a_plain_line() -> None:
    lines = printed(ROWS).splitlines()
    assert lines[:3] == [
        "PASS  calm   seed 1  max_error_m ≤ 0.5: margin 0.125 (25 %)  1.5 s",
        "FAIL  gusts  seed 3  always altitude_m < 4: violated at t = 3.00 s  1.5 s",
        "PASS  hop    seed 1    1.5 s",
    ]
    assert "\x1b" not in "".join(lines)
    assert lines[-1] == "1 failed, 2 passed in 3.0 s on 2 processes"


FACTS = tuple((float(second), f"event {second}") for second in range(20))


def failed_with(check: Check) -> Row:
    return replace(ROWS[1], result=replace(ROWS[1].result, checks=(check,), texts=FACTS))


def test_a_failure_shows_the_events_around_the_first_violation() -> None:
    violated = failed_with(replace(BAD, time_s=6.5))
    lines = printed([violated]).splitlines()
    shown = [f"  {second:4d}.00 s  event {second}" for second in range(1, 11)]
    begin = lines.index("  events around t = 6.50 s:") + 1
    assert lines[begin : begin + 11] == [*shown, "  log and report: runs/x"]
    (flight,) = as_json([violated], 1.0, False)["flights"]
    assert [event["text"] for event in flight["events"]] == [f"event {second}" for second in range(1, 11)]
    assert flight["events"][0]["time_s"] == 1.0
    assert flight["checks"][0]["time_s"] == 6.5


@pytest.mark.parametrize(("at_s", "first"), [(0.5, 0), (18.5, 10), (None, 10)])
def test_ten_events_are_shown_of_any_violation(at_s: float | None, first: int) -> None:
    lines = printed([failed_with(replace(BAD, time_s=at_s))]).splitlines()
    assert ("  last events:" in lines) is (at_s is None)
    assert [line.split()[-1] for line in lines if " s  event" in line] == [
        str(second) for second in range(first, first + 10)
    ]


def test_a_passed_flight_has_no_events_in_the_document() -> None:
    assert as_json([row("calm", GOOD)], 1.0, False)["flights"][0]["events"] == []


def test_a_failed_outcome_is_told_once() -> None:
    sentence = "the mission was flown"
    wrong = Check("outcome failsafe", False, f"completed\n{sentence}")
    text = printed([row("calm", wrong)])
    assert text.count(sentence) == 1
    assert "FAIL  calm  seed 1  outcome failsafe: completed  1.5 s" in text


def test_a_failure_shows_values_and_the_command_that_repeats_it() -> None:
    text = printed(ROWS)
    assert "gusts, seed 3" in text
    assert "    > t = 3.00 s: altitude_m = 4.5" in text
    assert "  log and report: runs/x" in text
    assert "  repeat: gcs test missions/gusts.toml --seed 3 --repeat 1" in text


def test_a_terminal_has_a_bar_and_gets_its_cursor_back() -> None:
    text = printed(ROWS, width=80, force_terminal=True)
    assert "3 of 3 flights" in text
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")


def test_no_color_has_no_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[32m" not in printed(ROWS, force_terminal=True)


def test_an_error_of_a_flight_is_a_failure() -> None:
    result = not_flown("the process that flew it was killed by signal 9")
    assert not result.passed
    assert "killed by signal 9" in printed([Row(case("a"), result)])
