"""A campaign from its file to table and report; or one of its flights alone."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from flightstack.core.atomic_file import write_bytes_atomically, write_text_atomically
from gcs_cli.campaign.definition import Campaign, is_campaign, load_campaign
from gcs_cli.campaign.display import inputs_text, make_display
from gcs_cli.campaign.flyer import FlightPool, Flyer, case_of, check_flights
from gcs_cli.campaign.journal import (
    CSV,
    PARQUET,
    REPORT,
    Journal,
    changed_since,
    check_search,
    flown_before,
    open_journal,
    record_of,
)
from gcs_cli.campaign.options import CampaignOptions, continuing
from gcs_cli.campaign.page import render_campaign
from gcs_cli.campaign.plan import PlannedFlight, plan_flights
from gcs_cli.campaign.rows import Row, row_of
from gcs_cli.campaign.seek import run_search
from gcs_cli.campaign.statistics import pass_probability
from gcs_cli.campaign.table import write_tables
from gcs_cli.errors import DONE, FAILED, INTERRUPTED, USAGE, CliError, library
from gcs_cli.output import show_page
from gcs_cli.run_directory import LOG_NAME, REPORT_NAME, results_directory
from gcs_cli.scenarios.pool import Finished, Notice
from gcs_cli.scenarios.result import Wanted
from gcs_cli.scenarios.selection import missing_error


def run_campaign(pool: FlightPool, options: CampaignOptions, console: Console) -> int:
    """Fly what is not flown yet, write the table and the report; return the exit code. Raise ConfigError, CliError."""
    library("pyarrow", "gcs campaign")  # missing: say so before the flights
    if not options.file.exists():
        raise missing_error(options.file, is_campaign)
    campaign = load_campaign(options.file)
    if options.seek is not None and options.only is not None:
        flight = _searched(campaign, options.folder, options.only, console)
        return fly_only(pool, campaign, flight, options, console)
    if options.seek is not None:
        return run_search(pool, campaign, options, console)
    flights = plan_flights(campaign)
    if options.only is not None:
        return fly_only(pool, campaign, _numbered(campaign, flights, options.only), options, console)
    check_flights(campaign, flights)
    inputs = [flight.inputs for flight in flights]
    record = record_of("plan", campaign.path, campaign.files(inputs), flights)
    began_s = time.monotonic()
    with (
        results_directory(options.folder),
        open_journal(options.folder, record, options.overwrite) as journal,
    ):
        display = make_display(console, len(flights), journal.rows.values())
        try:
            Flyer(pool, campaign, journal, display, options).fly(flights)
        except KeyboardInterrupt:
            over = f"{journal.count()} of {len(flights)} flights are over"
            raise CliError(f"interrupted: {over}; {continuing(options)} continues", INTERRUPTED) from None
        finally:
            display.close()
        journal.check_unchanged(record_of("plan", campaign.path, campaign.files(inputs), flights))
        rows = ordered(journal)
        write_tables(options.folder, rows, options.csv)
        write_text_atomically(options.folder / REPORT, render_campaign(campaign, rows, options))
    _print_summary(rows, options, console, time.monotonic() - began_s)
    return DONE if all(row["passed"] for row in rows) else FAILED


def open_report(folder: Path) -> None:
    """Show the report of a campaign in the browser."""
    show_page(folder / REPORT)


def ordered(journal: Journal) -> list[Row]:
    """Return the rows of a journal in the order of their flights."""
    return [journal.rows[number] for number in sorted(journal.rows)]


def _searched(campaign: Campaign, folder: Path, number: int, console: Console) -> PlannedFlight:
    """Return a flight of the search in ``folder``; say what has changed since."""
    check_search(folder, record_of("seek", campaign.path, campaign.files(()), ()))
    flight = flown_before(folder, number)
    record = record_of("seek", campaign.path, campaign.files([flight.inputs]), ())
    if changed := changed_since(folder, record):
        _say(console, f"{changed} since the search: this flight may differ from its flight {number}")
    return flight


def _numbered(campaign: Campaign, flights: Sequence[PlannedFlight], number: int) -> PlannedFlight:
    if number > len(flights):
        raise CliError(f"--only {number}: {campaign.path} has {len(flights)} flights", USAGE)
    return flights[number - 1]


def fly_only(
    pool: FlightPool, campaign: Campaign, flight: PlannedFlight, options: CampaignOptions, console: Console
) -> int:
    """Fly one flight alone, keep its log and report, and print its row; return the exit code."""
    case = case_of(campaign, flight, options)
    wanted = Wanted(every_file=True, metrics=True)
    result = None
    for message in pool.fly([case], wanted):
        if isinstance(message, Notice) and not message.is_common:
            _say(console, message.line)
        elif isinstance(message, Finished):
            if message.result is None:
                raise CliError(f"flight {flight.number}: {message.reason}")
            result = message.result
    assert result is not None
    row, folder = row_of(flight, result), options.folder / case.label
    if result.log:
        folder.mkdir(parents=True, exist_ok=True)
        write_bytes_atomically(folder / LOG_NAME, result.log, survives_power_loss=False)
        write_text_atomically(folder / REPORT_NAME, result.report)
    if options.as_json:
        kept = str(folder) if result.log else None
        print(json.dumps({"event": "flight", **row, "kept": kept}, allow_nan=False), flush=True)
        return DONE if row["passed"] else FAILED
    _say(console, f"flight {flight.number}, seed {flight.seed}: {inputs_text(row)}")
    for check in result.checks:
        _say(console, f"{'PASS' if check.passed else 'FAIL'}  {check}")
    if result.log:
        _say(console, f"log and report: {folder}")
    return DONE if row["passed"] else FAILED


def _print_summary(rows: Sequence[Row], options: CampaignOptions, console: Console, wall_s: float) -> None:
    passed = sum(row["passed"] for row in rows)
    chance = pass_probability(passed, len(rows))
    files = [options.folder / name for name in (PARQUET, *((CSV,) if options.csv else ()), REPORT)]
    if options.as_json:
        facts: dict[str, Any] = {
            "flights": len(rows), "passed": passed, "failed": len(rows) - passed,
            "pass_probability": chance.share, "low": chance.low, "high": chance.high,
            "files": [str(file) for file in files],
        }  # fmt: skip
        print(json.dumps({"event": "campaign", **facts}, allow_nan=False), flush=True)
        return
    _say(console, f"{passed} of {len(rows)} flights passed in {wall_s:.1f} s: pass probability {chance}")
    _say(console, f"results: {', '.join(map(str, files))}")


def _say(console: Console, line: str) -> None:
    console.print(line, markup=False, highlight=False, soft_wrap=True)
