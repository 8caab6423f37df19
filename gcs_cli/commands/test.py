"""``gcs test``: fly scenario files and judge the flights."""

from __future__ import annotations

from pathlib import Path

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import INTERRUPTED, USAGE, CliError
from gcs_cli.scenarios.options import TestOptions
from gcs_cli.settings import settings_of

app = make_app(add_completion=False)


@app.command("test")
@expand_options
def fly_scenarios(context: typer.Context, options: TestOptions) -> None:
    """Fly scenario files and judge the flights.

    Exits with 0 if all passed, 1 if one failed, 2 for a bad file, 130 after Ctrl-C.
    """
    from gcs_cli.scenarios.pool import Pool, default_jobs

    if settings_of(context).link.connect is not None:
        raise CliError("test flies vehicles of its own: leave --connect out", USAGE)
    if options.watch and options.as_json:
        raise CliError("--watch and --json exclude each other", USAGE)
    _check_file("--junit", options.junit, (".xml",))
    _check_file("--report", options.report, (".html", ".htm"))
    jobs = options.jobs or default_jobs()
    try:
        with Pool(jobs) as pool:  # its first worker imports while this process does
            from gcs_cli.fly.fly_display import FlyConsole
            from gcs_cli.scenarios.run import run_once, run_watching

            run = run_watching if options.watch else run_once
            code = run(pool, options, FlyConsole(stderr=options.as_json, highlight=False))
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
