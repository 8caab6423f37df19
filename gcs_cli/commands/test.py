"""``gcs test``: fly scenario files and check the flights.

A module of its own, as each command: it is imported when it is used.
"""

from __future__ import annotations

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import INTERRUPTED, USAGE, CliError
from gcs_cli.scenarios.options import TestOptions
from gcs_cli.settings import check_output_file, settings_of

app = make_app(add_completion=False)


@app.command("test")
@expand_options
def fly_scenarios(context: typer.Context, options: TestOptions) -> None:
    """Fly scenario files and check the flights.

    Exits with 0 if all passed, 1 if one failed, 2 for a bad file, 130 after Ctrl-C.
    """
    from gcs_cli.scenarios.pool import Pool, default_jobs

    if settings_of(context).link.connect is not None:
        raise CliError("test flies vehicles of its own: leave --connect out", USAGE)
    if options.watch and options.as_json:
        raise CliError("--watch and --json exclude each other", USAGE)
    check_output_file("--junit", options.junit, (".xml",))
    check_output_file("--report", options.report, (".html", ".htm"))
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
