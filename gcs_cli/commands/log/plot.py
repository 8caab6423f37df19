"""``gcs log plot``: fields of a log file as curves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.process.command_line import make_app
from gcs_cli.charts.pages import render_page
from gcs_cli.commands.log.file import LogArgument
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.fields import Field, find_fields
from gcs_cli.logs.info import start_utc
from gcs_cli.logs.plot import field_figure, field_samples, terminal_panel
from gcs_cli.logs.reader import read_log, warn_if_damaged
from gcs_cli.logs.recording import Recording
from gcs_cli.output import Output
from gcs_cli.settings import JsonOption, OverwriteOption, output_of

app = make_app(add_completion=False)

_TEMPLATES = Path(__file__).resolve().parents[2] / "logs" / "templates"
_PANEL_ROWS = 12
_PRINTED = (".png", ".svg", ".pdf")
_TIMES: dict[str, Any] = {"min": 0.0, "max": 1e7}
FieldsArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="FIELD...",
        help="topic, topic.field, a part of it that is unique, or a pattern with *.",
        show_default=False,
    ),
]
PageOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a page with the charts.", show_default=False)
]
PictureOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a picture: .png, .svg or .pdf.", show_default=False)
]


@app.command()
def plot(
    context: typer.Context,
    log: LogArgument,
    fields: FieldsArgument,
    html: PageOption = None,
    png: PictureOption = None,
    begin: Annotated[
        float,
        typer.Option("--from", metavar="SECONDS", help="Start, from the start of the log.", **_TIMES),
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", metavar="SECONDS", help="End.", show_default=False, **_TIMES)
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
        raise CliError(f"--to: {end:g} must be after --from {begin:g}", USAGE)
    for file in (html, png):
        if file is not None:
            check_new(file, overwrite)
    recording = read_log(log)
    warn_if_damaged(recording, recording.source)
    found = list(dict.fromkeys(field for wanted in fields for field in find_fields(recording, wanted)))
    limits = begin, math.inf if end is None else end
    out = output_of(context, as_json)
    if html is not None:
        _write_page(html, recording, found, limits)
        out.say("page", f"page written to {html}", file=str(html))
    if png is not None:
        _print_figure(png, recording, found, limits)
        out.say("picture", f"picture written to {png}", file=str(png))
    if html is None and png is None:
        _print(out, recording, found, limits)


def _write_page(path: Path, recording: Recording, fields: list[Field], limits: tuple[float, float]) -> None:
    figure = field_figure(recording, fields, *limits)
    lines = [start_utc(recording) or "unknown date"]
    title = Path(recording.source).name
    page = render_page(_TEMPLATES, "fields.html", title=title, lines=lines, figures=[figure])
    write_text_atomically(path, page)


def _print_figure(path: Path, recording: Recording, fields: list[Field], limits: tuple[float, float]) -> None:
    from gcs_cli.charts.print_figure import write_figure

    write_figure(path, field_figure(recording, fields, *limits))


def _print(out: Output, recording: Recording, fields: list[Field], limits: tuple[float, float]) -> None:
    if out.as_json:
        for field in fields:
            time_s, values = field_samples(recording, field, *limits)
            out.say("field", "", name=field.label, time_s=time_s, values=values)
        return
    from rich.console import Console

    console = Console(highlight=False, emoji=False)
    for panel in field_figure(recording, fields, *limits).panels:
        console.print(terminal_panel(panel, console.width, _PANEL_ROWS), soft_wrap=True)
