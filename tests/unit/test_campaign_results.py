"""The rows of a campaign: journal, table and statistics."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from rich.console import Console

from flightstack.core.errors import ConfigError
from flightstack.testing.expectations import Check
from gcs_cli.campaign.display import LiveDisplay, make_display
from gcs_cli.campaign.journal import (
    JOURNAL,
    RECORD,
    RESULTS,
    Journal,
    changed_since,
    check_search,
    open_journal,
    record_of,
)
from gcs_cli.campaign.options import CampaignOptions
from gcs_cli.campaign.plan import PlannedFlight
from gcs_cli.campaign.rows import columns, row_of
from gcs_cli.campaign.run import run_campaign
from gcs_cli.campaign.statistics import pass_probability, quantiles, sensitivities, worst
from gcs_cli.campaign.table import write_csv, write_parquet
from gcs_cli.errors import INTERRUPTED, USAGE, CliError
from gcs_cli.scenarios.pool import Finished
from gcs_cli.scenarios.result import Result, not_flown

FLIGHTS = tuple(
    PlannedFlight(number, 100 + number, {"wind": 0.5 * number, "law": "pid"}) for number in range(1, 6)
)
FILE = Path("c.toml")
RECORD_1 = record_of("plan", FILE, {"c.toml": b"one", "hop.plan": b"plan"}, FLIGHTS)


def row(flight: PlannedFlight) -> Any:
    margin = 0.6 - 0.2 * flight.number
    checks = (
        Check("outcome completed", True, "completed"),
        Check("max_error_m ≤ 0.6", margin >= 0.0, "…", margin, 0.6),
        Check("always landed", True, "holds", float("inf"), None),
    )
    return row_of(
        flight, Result(checks, None, "completed", "done", 4.0, metrics={"max_error_m": 0.2 * flight.number})
    )


ROWS = [row(flight) for flight in FLIGHTS]


def test_row_has_margins_failures_and_robustness() -> None:
    last = ROWS[-1]
    assert (last["flight"], last["seed"], last["inputs"]) == (5, 105, {"wind": 2.5, "law": "pid"})
    assert (last["passed"], last["failed"]) == (False, ["max_error_m ≤ 0.6"])
    assert last["margins"] == {"max_error_m ≤ 0.6": pytest.approx(-0.4)}
    assert last["robustness"] == pytest.approx(-0.4 / 0.6)
    assert last["metrics"]["max_error_m"] == 1.0
    assert last["metrics"]["landing_error_m"] is None


def test_a_flight_that_ends_by_an_error_is_the_least_robust() -> None:
    ended = row_of(FLIGHTS[0], not_flown("no memory"))
    assert (ended["outcome"], ended["passed"], ended["robustness"], ended["closest"]) == (
        "error",
        False,
        -1.0,
        None,
    )


def test_journal_cut_at_any_byte_keeps_every_whole_row(tmp_path: Path) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        for each in ROWS[:2]:
            journal.add(each)
    content = (tmp_path / JOURNAL).read_bytes()
    ends = [index + 1 for index, byte in enumerate(content) if byte == ord("\n")]
    for cut in range(len(content) + 1):
        (tmp_path / JOURNAL).write_bytes(content[:cut])
        whole = sum(end <= cut for end in ends)
        with open_journal(tmp_path, RECORD_1) as journal:
            assert [journal.rows[number] for number in sorted(journal.rows)] == ROWS[:whole]
            for each in ROWS[whole:2]:
                journal.add(each)
        assert (tmp_path / JOURNAL).read_bytes() == content


@pytest.mark.parametrize("damaged", [b"{", b"3", b"{}", b'{"flight": "x"}', b'{"flight": Infinity}'])
def test_damaged_line_is_named_and_the_file_stays(tmp_path: Path, damaged: bytes) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        for each in ROWS[:3]:
            journal.add(each)
    lines = (tmp_path / JOURNAL).read_bytes().splitlines()
    lines[1] = damaged
    content = b"\n".join(lines) + b"\n"
    (tmp_path / JOURNAL).write_bytes(content)
    with pytest.raises(CliError, match=f"^{tmp_path / JOURNAL}: line 2 is damaged"):
        Journal(tmp_path, RECORD_1)
    assert (tmp_path / JOURNAL).read_bytes() == content


def test_full_disk_names_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with open_journal(tmp_path, RECORD_1) as journal:
        monkeypatch.setattr(os, "fsync", fail)
        with pytest.raises(OSError, match="No space left") as raised:
            journal.add(ROWS[0])
        assert raised.value.filename == str(tmp_path / JOURNAL)


def test_journal_is_written_before_add_returns(tmp_path: Path) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        journal.add(ROWS[0])
        assert json.loads((tmp_path / JOURNAL).read_text()) == ROWS[0]


def test_each_row_is_synced_before_add_returns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[bytes] = []
    with open_journal(tmp_path, RECORD_1) as journal:
        monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append((tmp_path / JOURNAL).read_bytes()))
        for each in ROWS[:2]:
            journal.add(each)
            assert synced.pop() == (tmp_path / JOURNAL).read_bytes()


@pytest.mark.parametrize(
    ("record", "difference"),
    [
        (record_of("plan", FILE, {"c.toml": b"two", "hop.plan": b"plan"}, FLIGHTS), "c.toml has changed"),
        (record_of("plan", FILE, {"c.toml": b"one"}, FLIGHTS), "hop.plan has changed"),
        (
            record_of("plan", FILE, {"c.toml": b"one", "hop.plan": b"plan"}, FLIGHTS[:3]),
            "the plan of the flights has changed",
        ),
        ({**RECORD_1, "version": "9.9"}, f"flightstack has changed from {RECORD_1['version']} to 9.9"),
        ({**RECORD_1, "sources": "0"}, "the source code of flightstack has changed"),
    ],
)
def test_a_changed_campaign_is_refused_and_its_rows_stay(
    tmp_path: Path, record: Any, difference: str
) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        journal.add(ROWS[0])
    remedy = "give another --out, or --overwrite to fly all of them again"
    with pytest.raises(CliError, match=rf"^{tmp_path}: {difference} since its flights: {remedy}$"):
        Journal(tmp_path, record)
    with open_journal(tmp_path, RECORD_1) as journal:
        assert list(journal.rows) == [1]
    with open_journal(tmp_path, record, overwrite=True) as journal:
        assert journal.rows == {}


@pytest.mark.parametrize(
    ("record", "held"),
    [
        (record_of("plan", Path("d.toml"), {"d.toml": b"two"}, FLIGHTS), "the campaign of c.toml"),
        (
            record_of("seek", FILE, {"c.toml": b"one", "hop.plan": b"plan"}, FLIGHTS),
            "a campaign without --seek",
        ),
        ({**RECORD_1, "form": 0}, "the campaign of another version of flightstack"),
    ],
    ids=["other file", "search", "other form"],
)
def test_directory_of_another_campaign_is_refused_with_its_file(
    tmp_path: Path, record: Any, held: str
) -> None:
    with open_journal(tmp_path, RECORD_1):
        pass
    remedy = "give another --out, or --overwrite to replace it"
    with pytest.raises(CliError) as refused:
        Journal(tmp_path, record)
    assert (refused.value.exit_code, str(refused.value)) == (
        USAGE,
        f"{tmp_path}: the directory holds {held}: {remedy}",
    )


@pytest.mark.parametrize("path", [Path("moved/c.toml"), Path("renamed.toml")])
def test_campaign_whose_file_has_moved_continues(tmp_path: Path, path: Path) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        journal.add(ROWS[0])
    moved = record_of("plan", path, {path.name: b"one", "hop.plan": b"plan"}, FLIGHTS)
    with open_journal(tmp_path, moved) as journal:
        assert list(journal.rows) == [1]
    assert changed_since(tmp_path, moved) == ""


def test_flight_of_a_search_of_another_version_can_be_flown(tmp_path: Path) -> None:
    """It may differ, which is said; that of another campaign is refused."""
    with open_journal(tmp_path, RECORD_1):
        pass
    former = {name: value for name, value in RECORD_1.items() if name != "campaign"} | {
        "form": 1,
        "version": "0",
    }
    (tmp_path / RECORD).write_text(json.dumps(former))
    check_search(tmp_path, RECORD_1)
    assert changed_since(tmp_path, RECORD_1).startswith("flightstack has changed from 0 to ")
    (tmp_path / RECORD).write_text(json.dumps(RECORD_1))
    with pytest.raises(CliError, match=r"holds the campaign of c.toml: give the --out of the search"):
        check_search(tmp_path, record_of("plan", Path("d.toml"), {"d.toml": b"two"}, FLIGHTS))


def test_two_campaigns_do_not_write_to_one_directory(tmp_path: Path) -> None:
    with open_journal(tmp_path, RECORD_1):
        with pytest.raises(CliError, match="another gcs campaign writes to it"):
            Journal(tmp_path, RECORD_1)
        with pytest.raises(CliError, match="another gcs campaign writes to it"):
            Journal(tmp_path, RECORD_1, overwrite=True)
    with open_journal(tmp_path, RECORD_1):
        pass


def test_a_journal_without_its_record_is_refused(tmp_path: Path) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        journal.add(ROWS[0])
    os.unlink(tmp_path / RECORD)
    with pytest.raises(Exception, match=f"is missing beside {JOURNAL}"):
        Journal(tmp_path, RECORD_1)


@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b'{"files": 3}', b"\xff"])
def test_a_damaged_record_is_refused(tmp_path: Path, content: bytes) -> None:
    with open_journal(tmp_path, RECORD_1) as journal:
        journal.add(ROWS[0])
    (tmp_path / RECORD).write_bytes(content)
    with pytest.raises(ConfigError, match="is damaged"):
        Journal(tmp_path, RECORD_1)


@pytest.mark.parametrize("name", RESULTS)
def test_a_new_campaign_keeps_files_of_other_commands(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("other")
    with pytest.raises(ConfigError, match=f"{name}: exists already: give another --out, or --overwrite"):
        Journal(tmp_path, RECORD_1)
    assert (tmp_path / name).read_text() == "other"
    assert [path.name for path in tmp_path.iterdir()] == [name]
    with open_journal(tmp_path, RECORD_1, overwrite=True):
        assert not (tmp_path / name).exists()


def test_table_does_not_depend_on_the_order_of_the_rows(tmp_path: Path) -> None:
    names = []
    for name, rows in (("a", ROWS), ("b", [*ROWS[3:], *reversed(ROWS[:3])])):
        write_parquet(tmp_path / f"{name}.parquet", rows)
        write_csv(tmp_path / f"{name}.csv", rows)
        names.append((tmp_path / f"{name}.parquet", tmp_path / f"{name}.csv"))
    assert [path.read_bytes() for path in names[0]] == [path.read_bytes() for path in names[1]]


def test_tables_hold_the_rows(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    write_parquet(tmp_path / "t.parquet", ROWS)
    table = parquet.read_table(tmp_path / "t.parquet")
    assert table.to_pydict() == columns(ROWS)
    types = {field.name: str(field.type) for field in table.schema}
    assert types["flight"] == "int64"
    assert (
        types["input: wind"]
        == types["margin: max_error_m ≤ 0.6"]
        == types["metric: landing_error_m"]
        == "double"
    )
    assert types["input: law"] == types["failed"] == "string"
    write_csv(tmp_path / "t.csv", ROWS)
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["input: wind"]) for line in lines] == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert lines[-1]["failed"] == "max_error_m ≤ 0.6"


def test_pass_probability_is_that_of_clopper_and_pearson() -> None:
    found = pass_probability(8, 10)
    # Clopper, Pearson: 0.4439 to 0.9748 for 8 of 10
    assert (found.low, found.share, found.high) == pytest.approx((0.4439, 0.8, 0.9748), abs=5e-5)


def test_sensitivity_is_a_rank_correlation() -> None:
    (only,) = sensitivities(ROWS)
    assert (only.name, only.correlation) == ("wind", pytest.approx(-1.0))
    assert sensitivities(ROWS[:2]) == []


def test_worst_flights_come_first() -> None:
    assert [each["flight"] for each in worst(ROWS, 2)] == [5, 4]


def test_quantiles_leave_out_missing_numbers() -> None:
    assert quantiles([None, 1.0, 2.0, 3.0]) == pytest.approx((1.0, 1.1, 2.0, 2.9, 3.0))
    assert quantiles([None]) is None


def test_lost_flight_is_named_and_no_longer_under_way() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=100, color_system=None)
    display = LiveDisplay(console, 5, ROWS[:1])
    for number in (2, 3):
        display.begin(number)
    display.lose(2, "was killed by signal 9")
    display.tick()
    display.add(ROWS[2])
    display.close()
    shown = console.file.getvalue()
    assert "LOST  flight 2: was killed by signal 9" in shown
    assert shown.index("in flight: 2, 3") < shown.index("in flight: 3") < shown.rindex("in flight: none")


def test_long_inputs_leave_room_for_flight_and_margin() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    long = {f"wind.mean_m_s[{number}]": 0.25 for number in range(9)}
    LiveDisplay(console, 5, [{**each, "inputs": long, "closest": "x" * 50} for each in ROWS]).close()
    shown = console.file.getvalue()
    assert re.search(r"\b5 +-\d+\.\d %  x{31}…  wind\.mean", shown), shown


def test_lines_show_failures_and_each_tenth() -> None:
    console = Console(file=io.StringIO(), width=200)
    display = make_display(console, 5, ROWS[:1])
    for each in ROWS[1:]:
        display.begin(each["flight"])
        display.add(each)
    display.close()
    assert console.file.getvalue().splitlines() == [
        "1 of 5 flights are over already",
        "2 of 5 flights, 0 failed",
        "FAIL  flight 3: max_error_m ≤ 0.6; wind 1.5, law pid",
        "3 of 5 flights, 1 failed",
        "FAIL  flight 4: max_error_m ≤ 0.6; wind 2, law pid",
        "4 of 5 flights, 2 failed",
        "FAIL  flight 5: max_error_m ≤ 0.6; wind 2.5, law pid",
        "5 of 5 flights, 3 failed",
    ]


def test_plan_that_changes_during_the_flights_is_no_result(tmp_path: Path) -> None:
    plan = tmp_path / "own.plan"
    plan.write_bytes((Path(__file__).parents[2] / "missions" / "hop.plan").read_bytes())
    file = tmp_path / "c.toml"
    vary = "'force_n[0]' = {uniform = [0, 1]}"
    file.write_text(f"plan = 'own.plan'\n[campaign]\nflights = 2\n[vary]\n{vary}\n[expect]\n")
    changed = plan.read_bytes() + b"\n"

    class Pool:
        def fly(self, cases: Sequence[Any], wanted: Any) -> Iterator[Finished]:
            for number in range(len(cases)):
                plan.write_bytes(changed)
                yield Finished(number, Result(()))

    options, console = CampaignOptions(file, out=tmp_path / "out"), Console(file=io.StringIO())
    with pytest.raises(CliError, match=r"^own.plan has changed during the flights: --overwrite") as refused:
        run_campaign(Pool(), options, console)
    assert refused.value.exit_code == USAGE
    assert not (options.folder / "flights.parquet").exists()
    assert run_campaign(Pool(), replace(options, overwrite=True), console) == 0
    assert (options.folder / "flights.parquet").exists()


def test_a_row_counts_if_ctrl_c_comes_after_its_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_journal(tmp_path, record_of("plan", Path("c.toml"), {}, ())) as journal:
        monkeypatch.setattr(os, "fsync", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            journal.add({"flight": 1})
        assert (len(journal.rows), journal.count()) == (0, 1)


def test_interrupted_campaign_with_a_damaged_journal_is_interrupted(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    vary = "'force_n[0]' = {uniform = [0, 1]}"
    file.write_text(f"plan = 'hop'\n[campaign]\nflights = 2\n[vary]\n{vary}\n[expect]\n")

    class Pool:
        def fly(self, cases: Sequence[Any], wanted: Any) -> Iterator[Finished]:
            yield Finished(0, Result(()))
            (tmp_path / "out" / JOURNAL).write_bytes(b"{\n")
            raise KeyboardInterrupt

    options = CampaignOptions(file, out=tmp_path / "out")
    with pytest.raises(CliError, match=r"^interrupted: 1 of 2 flights are over; ") as ended:
        run_campaign(Pool(), options, Console(file=io.StringIO()))
    assert ended.value.exit_code == INTERRUPTED
