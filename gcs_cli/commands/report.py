"""``gcs report``: the report page of a flight, from its log alone or with the summary beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.reader import warn_if_damaged
from gcs_cli.output import show_page
from gcs_cli.report.compare import read_runs
from gcs_cli.report.page import render_report
from gcs_cli.report.poses import find_run
from gcs_cli.report.summary import file_sha256
from gcs_cli.report.telemetry import read_loop_timing
from gcs_cli.run_directory import LOG_NAME, REPORT_NAME, TLOG_NAME
from gcs_cli.settings import JsonOption, OpenOption, OverwriteOption, output_of

app = make_app(add_completion=False)


@app.command()
def report(
    context: typer.Context,
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="A ULog, or the directory of a flight.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="The page to write.  [default: LOG.html beside the log]"
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    open_page: OpenOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write the report page of a flight from its log.

    The log may be any vehicle's ULog; charts of topics that it lacks stay empty.
    """
    run = find_run(log)
    page = _default(run.log) if out is None else out
    if page.suffix.lower() not in (".html", ".htm"):
        raise CliError(f"--out {page}: give the page a name that ends in .html", USAGE)
    check_new(page, overwrite)
    (read,) = read_runs([run])
    flight, summary = read.flight, {**read.summary, "log_sha256": file_sha256(run.log)}
    warn_if_damaged(flight, run.log)
    tlog = run.log.with_name(TLOG_NAME)
    timing = read_loop_timing(tlog, flight.start_s) if run.summary else ()
    write_text_atomically(page, render_report(flight, read.plan, summary, timing, read.name))
    output_of(context, as_json).say("report", f"report written to {page}", file=str(page), summary=summary)
    if open_page:
        show_page(page)


def _default(log: Path) -> Path:
    return log.with_name(REPORT_NAME) if log.name == LOG_NAME else log.with_suffix(".html")
