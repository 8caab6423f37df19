"""``gcs test`` and ``gcs campaign``: fly scenarios as they are, and one scenario with varied inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.campaign.options import FLIGHTS, SEEKS, CampaignOptions
from gcs_cli.errors import INTERRUPTED, USAGE, CliError, library
from gcs_cli.scenarios.options import TestOptions
from gcs_cli.settings import check_output_file, settings_of

if TYPE_CHECKING:
    from gcs_cli.campaign.cluster import ClusterPool
    from gcs_cli.scenarios.pool import Pool

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


@app.command("campaign")
@expand_options
def fly_campaign(context: typer.Context, options: CampaignOptions) -> None:
    """Fly a scenario many times with varied inputs.

    Writes a table (Parquet) with a row for each flight, and a report. After Ctrl-C or a crash the same command
    continues. Exits with 0 if all flights passed, 1 if one failed, 2 for a bad file, 3 without the
    scheduler, 130 after Ctrl-C.
    """
    _check(context, options)
    try:
        with _pool(options) as pool:  # its first worker imports while this process does
            from gcs_cli.campaign.run import open_report, run_campaign
            from gcs_cli.fly.fly_display import FlyConsole

            code = run_campaign(pool, options, FlyConsole(stderr=options.as_json, highlight=False))
    except KeyboardInterrupt:  # not in flight
        raise CliError("interrupted", INTERRUPTED) from None
    if options.open_report and options.only is None:
        open_report(options.folder)
    raise typer.Exit(code)


def _pool(options: CampaignOptions) -> Pool | ClusterPool:
    """Return the workers of the campaign; raise CliError (usage) without the library for those of a cluster."""
    if options.scheduler is None:
        from gcs_cli.scenarios.pool import Pool, default_jobs

        return Pool(options.workers or default_jobs())
    library("distributed", "--scheduler", "cluster")
    from gcs_cli.campaign.cluster import ClusterPool

    return ClusterPool(options.scheduler)


def _check(context: typer.Context, options: CampaignOptions) -> None:
    """Raise CliError (usage) for options that exclude each other."""
    if settings_of(context).link.connect is not None:
        raise CliError("campaign flies vehicles of its own: leave --connect out", USAGE)
    if options.scheduler is not None and options.workers is not None:
        raise CliError(
            "--workers is for this machine: leave it out, the cluster has workers of its own", USAGE
        )
    if options.seek not in (None, *SEEKS):
        raise CliError(f"--seek: {options.seek} is not one of {', '.join(SEEKS)}", USAGE)
    if options.flights is None:
        return
    if options.seek is None:  # before the range, which is that of a search
        raise CliError("--flights is for --seek: a campaign's number of flights is in its file", USAGE)
    if options.flights not in FLIGHTS:
        limits = f"{FLIGHTS[0]} to {FLIGHTS[-1]}"
        raise CliError(f"--flights: {options.flights} is outside the allowed range {limits}", USAGE)
