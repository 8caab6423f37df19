"""``gcs log info|export``: a log file of any vehicle, ULog or tlog."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.core.errors import ConfigError
from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs import export_mcap, export_rerun, export_tables
from gcs_cli.logs.info import info_lines
from gcs_cli.logs.reader import read_log, warn_if_damaged
from gcs_cli.settings import JsonOption, OverwriteOption, output_of

app = make_app(add_completion=False)

LogArgument = Annotated[
    Path,
    typer.Argument(
        metavar="LOG", help="A ULog or tlog file, or the directory of a flight.", show_default=False
    ),
]


@app.command()
def info(context: typer.Context, log: LogArgument, as_json: JsonOption = False) -> None:
    """Show what a log holds.

    Times, vehicle, topics with their rates, dropouts, changed parameters, texts.
    """
    out = output_of(context, as_json)
    for line in info_lines(read_log(log)):
        out.say(line.event, line.sentence, **line.facts)


_Csv = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Write a CSV file for each topic.", show_default=False)
]
_Parquet = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Write a Parquet file for each topic.", show_default=False)
]
_Mcap = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write an MCAP file, for Foxglove and others.", show_default=False),
]
_Rerun = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a Rerun recording (.rrd).", show_default=False)
]


@app.command()
def export(
    context: typer.Context,
    log: LogArgument,
    csv: _Csv = None,
    parquet: _Parquet = None,
    mcap: _Mcap = None,
    rerun: _Rerun = None,
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
    warn_if_damaged(recording, recording.source)
    out = output_of(context, as_json)

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
