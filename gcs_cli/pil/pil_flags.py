"""The options of ``gcs pil``: those of its flights, and those of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import IN_OUTPUT
from flightstack.process.options import State
from gcs_cli.fly.fly_flags import FlyOptions, ResultOptions


@dataclass(frozen=True)
class PilOptions(FlyOptions):
    """The options of ``gcs fly`` for flights that compare loops: on the true state, which is no error of the loops."""

    state: State = "truth"


@dataclass(frozen=True)
class VerdictOptions(ResultOptions):
    """The options of a comparison and its verdict."""

    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Directory of the results.  [default: runs/<stamp>-<name>-pil]",
            **IN_OUTPUT,
        ),
    ] = None
    limits: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Limits of signals in place of the built-in ones (TOML).", **IN_OUTPUT
        ),
    ] = None
    junit: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the checks as JUnit XML for CI.", **IN_OUTPUT),
    ] = None
    fail_over: Annotated[
        bool,
        typer.Option("--fail-over", help="Exit with 1 when a difference is over its limit.", **IN_OUTPUT),
    ] = False
