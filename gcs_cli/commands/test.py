"""``gcs test``: fly scenario files and judge the flights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import make_app
from gcs_cli.errors import INTERRUPTED, USAGE, CliError
from gcs_cli.settings import JsonOption, settings_of

app = make_app(add_completion=False)


@app.command("test")
def fly_scenarios(
    context: typer.Context,
    paths: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="PATH",
            help="Scenario files, and folders that are searched for them.  [default: the working directory]",
            show_default=False,
        ),
    ] = None,
    expression: Annotated[
        str | None,
        typer.Option(
            "-k", metavar="EXPR", help="Fly scenarios whose names match, such as `wind and not rotor`."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, max=256, help="Flights at once.  [default: one for each processor]"
        ),
    ] = None,
    repeat: Annotated[
        int | None, typer.Option(min=1, max=1_000_000, help="Flights of each scenario, with following seeds.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=2**31 - 1, help="Seed of the first flight of each scenario.")
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the results as JUnit XML, for CI servers.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a page with verdicts, margins and charts.")
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Directory for logs of failed flights.  [default: runs/<stamp>-test]"
        ),
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Fly again after each change of a file, until Ctrl-C.")
    ] = False,
    exitfirst: Annotated[bool, typer.Option("--exitfirst", "-x", help="Stop at the first failure.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fly scenario files and judge the flights.

    Exits with 0 if all passed, 1 if one failed, 2 for a bad file, 130 after Ctrl-C.
    """
    from gcs_cli.scenarios.pool import Pool, default_jobs

    if settings_of(context).link.connect is not None:
        raise CliError("test flies vehicles of its own: leave --connect out", USAGE)
    if watch and as_json:
        raise CliError("--watch and --json exclude each other", USAGE)
    _check_file("--junit", junit, (".xml",))
    _check_file("--report", report, (".html", ".htm"))
    jobs = jobs or default_jobs()
    try:
        with Pool(jobs) as pool:  # its first worker imports while this process does
            from gcs_cli.fly.fly_display import FlyConsole
            from gcs_cli.scenarios.run import TestOptions, run_once, run_watching

            options = TestOptions(
                tuple(paths or [Path()]),
                jobs,
                expression,
                seed,
                repeat,
                junit,
                report,
                keep,
                as_json,
                exitfirst,
            )
            run = run_watching if watch else run_once
            code = run(pool, options, FlyConsole(stderr=as_json, highlight=False))
    except KeyboardInterrupt:  # not in flight
        raise CliError("interrupted", INTERRUPTED) from None
    raise typer.Exit(code)


def _check_file(flag: str, path: Path | None, suffixes: tuple[str, ...]) -> None:
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise CliError(f"{flag} {path}: give the file a name that ends in {suffixes[0]}", USAGE)
    if not path.parent.is_dir():
        raise CliError(f"{flag} {path}: there is no directory {path.parent}", USAGE)
