"""``gcs log info|plot|export``: a log file of any vehicle, ULog or tlog."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.process.command_line import make_app
from flightstack.process.console import complain
from gcs_cli.charts.pages import render_page
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.fields import Field, find_fields
from gcs_cli.logs.info import info_lines, start_utc
from gcs_cli.logs.plot import field_figure, field_samples, terminal_panel
from gcs_cli.logs.reader import read_log
from gcs_cli.logs.recording import Recording
from gcs_cli.output import Output
from gcs_cli.settings import JsonOption, OverwriteOption, output_of

app = make_app(add_completion=False)

LogArgument = Annotated[
    Path,
    typer.Argument(
        metavar="LOG", help="A ULog or tlog file, or the directory of a flight.", show_default=False
    ),
]
_TEMPLATES = Path(__file__).resolve().parents[1] / "logs" / "templates"
_PANEL_ROWS = 12
_PRINTED = (".png", ".svg", ".pdf")


@app.command()
def info(context: typer.Context, log: LogArgument, as_json: JsonOption = False) -> None:
    """Show what a log holds.

    Times, vehicle, topics with their rates, dropouts, changed parameters, texts.
    """
    out = output_of(context, as_json)
    for line in info_lines(read_log(log)):
        out.say(line.event, line.sentence, **line.facts)


@app.command()
def plot(
    context: typer.Context,
    log: LogArgument,
    fields: Annotated[
        list[str],
        typer.Argument(
            metavar="FIELD...",
            help="topic, topic.field, a part of it that is unique, or a pattern with *.",
            show_default=False,
        ),
    ],
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a page with the charts.", show_default=False)
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a picture: .png, .svg or .pdf.", show_default=False),
    ] = None,
    begin: Annotated[
        float, typer.Option("--from", metavar="SECONDS", help="Start, from the start of the log.")
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", metavar="SECONDS", help="End.", show_default=False)
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Plot fields of a log.

    The plot is printed, or with --html and --png written to a file; --json prints the samples.
    """
    if png is not None and png.suffix.lower() not in _PRINTED:
        raise CliError(f"--png {png}: expected {', '.join(_PRINTED)}", USAGE)
    if end is not None and end <= begin:
        raise CliError(f"--to {end:g}: must be after --from {begin:g}", USAGE)
    for file in (html, png):
        if file is not None:
            check_new(file, overwrite)
    recording = read_log(log)
    _warn_if_damaged(recording)
    found = list(dict.fromkeys(field for wanted in fields for field in find_fields(recording, wanted)))
    limits = begin, math.inf if end is None else end
    out = output_of(context, as_json)
    if html is not None:
        figure = field_figure(recording, found, *limits)
        lines = [start_utc(recording) or "unknown date"]
        page = render_page(
            _TEMPLATES, "fields.html", title=Path(recording.source).name, lines=lines, figures=[figure]
        )
        write_text_atomically(html, page)
        out.say("page", f"page written to {html}", file=str(html))
    if png is not None:
        _print_figure(png, recording, found, limits)
        out.say("picture", f"picture written to {png}", file=str(png))
    if html is None and png is None:
        _print(out, recording, found, limits)


def _print_figure(path: Path, recording: Recording, fields: list[Field], limits: tuple[float, float]) -> None:
    from gcs_cli.charts.print_figure import write_figure  # noqa: PLC0415  # matplotlib

    write_figure(path, field_figure(recording, fields, *limits))


def _print(out: Output, recording: Recording, fields: list[Field], limits: tuple[float, float]) -> None:
    if out.as_json:
        for field in fields:
            time_s, values = field_samples(recording, field, *limits)
            out.say("field", "", name=field.label, time_s=time_s, values=values)
        return
    console = Console(highlight=False)
    for panel in field_figure(recording, fields, *limits).panels:
        console.print(terminal_panel(panel, console.width, _PANEL_ROWS), soft_wrap=True)


@app.command()
def export(
    context: typer.Context,
    log: LogArgument,
    csv: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a CSV file for each topic.", show_default=False)
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write a Parquet file for each topic.", show_default=False),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write an MCAP file, for Foxglove and others.", show_default=False),
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a Rerun recording (.rrd).", show_default=False)
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Export a log as CSV, Parquet, MCAP or Rerun.

    Several at once are allowed. Parquet, MCAP and Rerun need the extra `export`.
    """
    if csv is None and parquet is None and mcap is None and rerun is None:
        raise CliError("give one of --csv DIR, --parquet DIR, --mcap FILE, --rerun FILE", USAGE)
    for file in (mcap, rerun):
        if file is not None:
            check_new(file, overwrite)
            if file.is_dir():
                raise ConfigError(file, "", "is a directory")
    recording = read_log(log)
    _warn_if_damaged(recording)
    out = output_of(context, as_json)
    from gcs_cli.logs import export_mcap, export_rerun, export_tables  # noqa: PLC0415

    def say(form: str, path: Path, count: int, unit: str) -> None:
        out.say("exported", f"{count} {unit} written to {path}", format=form, path=str(path), count=count)

    if csv is not None:
        say("csv", csv, export_tables.export_csv(recording, csv, overwrite), "tables")
    if parquet is not None:
        say("parquet", parquet, export_tables.export_parquet(recording, parquet, overwrite), "tables")
    if mcap is not None:
        say("mcap", mcap, export_mcap.export_mcap(recording, mcap), "messages")
    if rerun is not None:
        say("rerun", rerun, export_rerun.export_rerun(recording, rerun), "entities")


def _warn_if_damaged(recording: Recording) -> None:
    if recording.damaged:
        complain(
            f"gcs: warning: {recording.source}: the log is damaged; read up to {recording.duration_s:.1f} s"
        )
