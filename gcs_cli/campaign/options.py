"""The options of ``gcs campaign``.

A module of its own: the help imports no scenario.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import IN_OUTPUT, Overwrite
from gcs_cli.settings import JsonOption, OpenOption

SEEKS = ("worst",)
FLIGHTS = range(20, 100_001)
"""Allowed flights of a search."""
File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="A scenario file with [campaign] and [vary], such as examples/campaigns/hop_in_gusts.toml.",
        show_default=False,
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        "-j",
        min=1,
        max=256,
        metavar="N",
        help="Flights at once.  [default: one for each processor]",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Fly on the Dask cluster of this scheduler, such as tcp://10.0.0.1:8786."
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="DIR", help="Directory of the results, where a campaign also continues.  "
                 "[default: runs/campaign-<file>]", **IN_OUTPUT),
]  # fmt: skip
Csv = Annotated[bool, typer.Option("--csv", help="Write the table as CSV too.", **IN_OUTPUT)]
Only = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Fly this flight alone, and keep its log and report."),
]
Seek = Annotated[
    str | None,
    typer.Option(
        metavar="worst",
        help="Search for the least margin and for the smallest disturbance that violates an expectation.",
    ),
]
Flights = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help=f"Most flights of a search, {FLIGHTS[0]} to {FLIGHTS[-1]}; fewer find the boundary less exactly.  "
        "[default: 200]",
    ),
]


@dataclass(frozen=True)
class CampaignOptions:
    """The options of ``gcs campaign``, as given."""

    file: File
    workers: Workers = None
    scheduler: Scheduler = None
    out: Out = None
    csv: Csv = False
    only: Only = None
    seek: Seek = None
    flights: Flights = None
    overwrite: Overwrite = False
    open_report: OpenOption = False
    as_json: JsonOption = False

    @property
    def folder(self) -> Path:
        """The directory of the results."""
        return self.out or Path("runs") / f"campaign-{self.file.stem}"


def continuing(options: CampaignOptions) -> str:
    """Return which command continues the campaign, as the subject of a sentence: --overwrite would begin it anew."""
    return f"the same command{' without --overwrite' if options.overwrite else ''}"


def only_command(options: CampaignOptions, number: int) -> str:
    """Return the command that flies one flight alone."""
    out = f" --out {shlex.quote(str(options.out))}" if options.out is not None else ""
    seek = "" if options.seek is None else f" --seek {options.seek}"
    return f"gcs campaign {shlex.quote(str(options.file))}{seek}{out} --only {number}"
