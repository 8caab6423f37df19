"""The options of ``gcs test``.

A module of its own: the help imports no scenario.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from gcs_cli.settings import JsonOption

Paths = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="PATH",
        help="Scenario files, and folders that are searched for them.  [default: the working directory]",
        show_default=False,
    ),
]
Selection = Annotated[
    str | None,
    typer.Option(
        "-k", metavar="EXPR", help="Fly scenarios whose names match, such as `wind and not rotor-2`."
    ),
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        "-j",
        min=1,
        max=256,
        metavar="N",
        help="Flights at once.  [default: one for each processor]",
    ),
]
Repeat = Annotated[
    int | None,
    typer.Option(min=1, max=1_000_000, metavar="N", help="Flights of each scenario, with following seeds."),
]
Seed = Annotated[
    int | None,
    typer.Option(min=0, max=2**31 - 1, metavar="N", help="Seed of the first flight of each scenario."),
]
JUnit = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write the results as JUnit XML, for CI servers.")
]
Report = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a page with verdicts, margins and charts.")
]
Keep = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Directory for logs of failed flights.  [default: runs/<stamp>-test]"),
]
Watch = Annotated[bool, typer.Option("--watch", help="Fly again after each change of a file, until Ctrl-C.")]
ExitFirst = Annotated[bool, typer.Option("--exitfirst", "-x", help="Stop at the first failure.")]


@dataclass(frozen=True)
class TestOptions:
    """The options of ``gcs test``, as given."""

    paths: Paths = None
    expression: Selection = None
    jobs: Jobs = None
    repeat: Repeat = None
    seed: Seed = None
    junit: JUnit = None
    report: Report = None
    keep: Keep = None
    watch: Watch = False
    exitfirst: ExitFirst = False
    as_json: JsonOption = False

    __test__ = False  # not a test of pytest's
