"""``gcs compare``: flights side by side, as a page and a table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.logs.reader import warn_if_damaged
from gcs_cli.output import show_page
from gcs_cli.report.compare import (
    ComparedRun,
    Row,
    comparison,
    condition_rows,
    figure_rows,
    read_runs,
    render_comparison,
)
from gcs_cli.report.poses import find_run
from gcs_cli.run_directory import COMPARISON_NAME as PAGE_NAME
from gcs_cli.run_directory import write_page
from gcs_cli.settings import JsonOption, OverwriteOption, check_page

app = make_app(add_completion=False)

_DEFAULT = f"[default: {PAGE_NAME} beside the first log]"
_Page = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="FILE", help=f"The page to write.  {_DEFAULT}")
]


@app.command()
def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN RUN...", help="Directories of flights, or logs.", show_default=False),
    ],
    out: _Page = None,
    overwrite: OverwriteOption = False,
    open_page: Annotated[bool, typer.Option("--open", help="Open the page afterwards.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare two or more flights.

    Prints their figures side by side, and writes a page with their charts overlaid.
    """
    if len(runs) < 2:
        raise CliError("give two flights or more to compare", USAGE)
    found = [find_run(path) for path in runs]
    page = found[0].log.with_name(PAGE_NAME) if out is None else out
    check_page(page)
    read = read_runs(found)
    for run in read:
        warn_if_damaged(run.flight, run.log)
    failure = write_page(page, render_comparison(read), overwrite)
    if as_json:
        facts = comparison(read, page if failure is None else None)
        print(json.dumps(facts, allow_nan=False), flush=True)
    else:
        FlyConsole(highlight=False).print(comparison_table(read))
    if failure is not None:
        raise failure
    if not as_json:
        print(f"page written to {page}", flush=True)
    if open_page:
        show_page(page)


def comparison_table(runs: Sequence[ComparedRun]) -> Table:
    """Return conditions and figures, a column for each flight."""
    summaries = [run.summary for run in runs]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for run in runs:
        table.add_column(Text(run.name), justify="right", overflow="fold")
    for row in condition_rows(summaries):
        table.add_row(*_cells(row, "≠ " if row.differs else ""), style="yellow" if row.differs else None)
    table.add_section()
    for row in figure_rows(summaries):
        table.add_row(*_cells(row, ""))
    return table


def _cells(row: Row, mark: str) -> list[Any]:
    cells = [
        Text.assemble(text, (f" {change}" if change else "", "bright_black"))
        for text, change in zip(row.texts, row.changes, strict=True)
    ]
    return [Text(mark + row.title), *cells]
