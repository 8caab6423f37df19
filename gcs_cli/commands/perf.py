"""``gcs perf``: the timing of the flight stack's loops."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import NO_ANSWER, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.subscription import LOOP_TIMING
from gcs_cli.settings import JsonOption, LinkOptions, link_options
from gcs_cli.tables import new_table, table_console
from gcs_cli.vehicle.field_units import number
from gcs_cli.vehicle.view_types import LoopTiming
from gcs_cli.vehicle_link import connect_vehicle

if TYPE_CHECKING:
    from rich.table import Table

app = make_app(add_completion=False)


@app.command()
@expand_options
def perf(
    context: typer.Context,
    link: LinkOptions,
    repeat: Annotated[bool, typer.Option("--watch", help="Repeat until Ctrl-C.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the timing of the flight stack's loops."""
    timeout_s = link_options(context, link).timeout_s
    with connect_vehicle(context, link, takes_recording=True, in_real_time=False) as connection:
        connection.session.subscribe(LOOP_TIMING)
        timing = next_timing(connection, None, timeout_s)
        _show(timing, as_json)
        try:
            while repeat:
                timing = next_timing(connection, timing, timeout_s)
                _show(timing, as_json)
        except KeyboardInterrupt:
            return


def next_timing(connection: Connection, before: LoopTiming | None, timeout_s: float) -> LoopTiming:
    """Wait for the next FS_LOOP_TIMING after ``before``; raise CliError (no answer)."""
    session = connection.session
    if not connection.wait_for(lambda: session.view.timing not in (None, before), timeout_s):
        raise CliError(
            f"the vehicle sent no FS_LOOP_TIMING within {timeout_s:g} s: only flightstack does, while its "
            "loops run",
            NO_ANSWER,
        )
    assert session.view.timing is not None
    return session.view.timing


def _show(timing: LoopTiming, as_json: bool) -> None:
    if as_json:
        print(json.dumps(timing._asdict()), flush=True)
        return
    table_console().print(timing_table(timing))
    sys.stdout.flush()


def timing_table(timing: LoopTiming) -> Table:
    """Return the timing as a table: times in µs, and in percent of the inner loop's period."""
    clock = "lockstep" if timing.lockstep else "real time"
    factor = f", {timing.real_time_factor:.1f}× real time" if timing.real_time_factor else ""
    title = f"inner {number(timing.inner_hz, 0)} Hz, outer {number(timing.outer_hz, 0)} Hz, {clock}{factor}"
    period_us = 1e6 / timing.inner_hz if timing.inner_hz else None
    table = new_table(title=title, title_justify="left")
    table.add_column("last 4096 ticks")
    for name in ("mean", "p99", "max"):
        table.add_column(f"{name} µs", justify="right")
        table.add_column("%", justify="right", style="bright_black")
    rows = {
        "execution of a tick": (timing.execution_mean_us, timing.execution_p99_us, timing.execution_max_us)
    }
    if not timing.lockstep:
        rows["lateness of a tick"] = (timing.lateness_mean_us, timing.lateness_p99_us, timing.lateness_max_us)
    for name, values in rows.items():
        cells = []
        for value in values:
            share = None if value is None or period_us is None else 100.0 * value / period_us
            cells += [number(value, 1), number(share, 1)]
        table.add_row(name, *cells)
    late = "" if timing.lockstep else f", {timing.overruns} overruns, {timing.missed} deadlines missed"
    table.caption = f"t {timing.time_s:.1f} s: {timing.ticks} ticks{late}"
    table.caption_justify = "left"
    return table
