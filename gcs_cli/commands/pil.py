"""``gcs pil``: the loops on a target, checked against those in Python and in C."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from flightstack.process.command_line import HELP_FLAGS, make_app
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.fly.fly_flags import FlyOptions, flies
from gcs_cli.settings import FlownInstanceOption, JsonOption, OverwriteOption, settings_of

if TYPE_CHECKING:
    from gcs_cli.pil.result import Outcome

_FLY = "fly"


class _MissionGroup(TyperGroup):
    """Takes what is no command for the mission: ``gcs pil square.plan`` is ``gcs pil fly square.plan``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and args[0] not in HELP_FLAGS:
            args = [_FLY, *args]
        return super().parse_args(ctx, args)


app = make_app(
    cls=_MissionGroup,
    help="Check the loops in C and on a target.\n\n`gcs pil MISSION` flies it as MIL, SIL and PIL.",
    no_args_is_help=True,
)

TargetOption = Annotated[
    str, typer.Option(metavar="TARGET", help="emulated, host, or serial:DEVICE[:BAUD].", show_default=True)
]
FailOverOption = Annotated[
    bool, typer.Option("--fail-over", help="Exit with 1 when a difference is over its limit.")
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", "-o", help="Directory of the results.  [default: runs/<stamp>-<name>-pil]"),
]
OpenOption = Annotated[bool, typer.Option("--open", help="Open the report afterwards.")]


@app.command(_FLY)
@flies(without=("loops", "speed"))
def fly(
    context: typer.Context,
    options: FlyOptions,
    target: TargetOption = "emulated",
    instance: FlownInstanceOption = None,
    out: OutOption = None,
    overwrite: OverwriteOption = False,
    fail_over: FailOverOption = False,
    open_report: OpenOption = False,
    as_json: JsonOption = False,
    timeout: Annotated[float | None, typer.Option(help="Wait for the vehicle, s.  [default: 180]")] = None,
) -> None:
    """Fly a mission with each of the loops, and compare.

    The loops fly in Python (MIL), in C (SIL) and on a target (PIL).
    """
    from gcs_cli.fly.fly_display import FlyConsole  # noqa: PLC0415
    from gcs_cli.fly.fly_options import checked_plan  # noqa: PLC0415
    from gcs_cli.pil.run import run  # noqa: PLC0415
    from gcs_cli.pil.targets import checked_target  # noqa: PLC0415

    settings = settings_of(context).merged(None, timeout, instance)
    if settings.connect is not None:
        raise CliError("pil starts a vehicle of its own: leave --connect out, or see --instance", USAGE)
    timeout_s = FlyOptions.timeout_s if settings.timeout_s is None else settings.timeout_s
    options = replace(options, instance=settings.instance or 0, timeout_s=timeout_s)
    checked_target(target)
    items = checked_plan(options)
    console = FlyConsole(stderr=as_json, highlight=False)
    finished = run(options, items, target, out, console, overwrite)
    _tell(finished.outcome, finished.folder, console, as_json, open_report)
    if finished.problem is not None:
        raise finished.problem
    _judge(finished.outcome, fail_over)


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(help="A flight log (ULog).", show_default=False)],
    target: Annotated[
        str, typer.Option(metavar="TARGET", help="emulated, host, c, or serial:DEVICE[:BAUD].")
    ] = "emulated",
    vehicle: Annotated[
        str | None, typer.Option(help="The vehicle's TOML file.  [default: the log's vehicle, by its name]")
    ] = None,
    out: OutOption = None,
    fail_over: FailOverOption = False,
    open_report: OpenOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Feed a target with the inputs of a flight log.

    Its outputs are compared with those that the log holds.
    """
    from gcs_cli.fly.fly_display import FlyConsole  # noqa: PLC0415
    from gcs_cli.pil import replay_run  # noqa: PLC0415
    from gcs_cli.pil.run import make_pil_directory, write_outcome  # noqa: PLC0415
    from gcs_cli.pil.targets import checked_target  # noqa: PLC0415

    choice = checked_target(target, more=("c",))
    prepared = replay_run.prepared(log, vehicle)
    folder = make_pil_directory(log.stem, out, overwrite)
    console = FlyConsole(stderr=as_json, highlight=False)
    outcome = replay_run.replay(log, choice, target, prepared, folder, console)
    write_outcome(folder, outcome)
    _tell(outcome, folder, console, as_json, open_report)
    _judge(outcome, fail_over)


@app.command()
def doctor(
    port: Annotated[
        str | None,
        typer.Option(metavar="DEVICE", help="Serial port, /dev/ttyUSB1 for instance.", show_default=False),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(metavar="TARGET", help="In place of --port: host or emulated.", show_default=False),
    ] = None,
    baud: Annotated[
        list[int] | None,
        typer.Option(min=1_200, help="Rate to try; may be repeated.  [default: 115200 230400 460800 921600]"),
    ] = None,
    exchanges: Annotated[int, typer.Option(min=1, max=100_000, help="Steps to measure at each rate.")] = 300,
    as_json: JsonOption = False,
) -> None:
    """Find out how well the link to a target works, and what to change."""
    from gcs_cli.fly.fly_display import FlyConsole  # noqa: PLC0415
    from gcs_cli.pil import doctor as examination  # noqa: PLC0415
    from gcs_cli.pil.targets import checked_target  # noqa: PLC0415
    from gcs_cli.tui.transfer_bar import step_bar  # noqa: PLC0415

    if (port is None) == (target is None):
        raise CliError("give either --port DEVICE or --target", USAGE)
    choice = checked_target(f"serial:{port}" if target is None else target)
    bauds = baud or ([choice.baud] if target is not None else examination.BAUDS)
    console = FlyConsole(stderr=as_json, highlight=False)
    with step_bar("exchanges", console) as bar:
        found = examination.examine(choice, bauds, exchanges, bar.show)
    result = examination.findings(choice, found)
    if as_json:
        print(json.dumps(result), flush=True)
    else:
        examination.print_findings(console, result)
    examination.check_findings(result)


def _tell(outcome: Outcome, folder: Path, console: Any, as_json: bool, open_report: bool) -> None:
    from gcs_cli.pil.printed import print_outcome  # noqa: PLC0415
    from gcs_cli.pil.run import HTML_NAME  # noqa: PLC0415

    if as_json:
        print(json.dumps({**outcome.result, "directory": str(folder)}), flush=True)
    else:
        print_outcome(console, outcome.result, folder)
    if open_report:
        import webbrowser  # noqa: PLC0415

        webbrowser.open((folder / HTML_NAME).resolve().as_uri())


def _judge(outcome: Outcome, fail_over: bool) -> None:
    """With ``--fail-over``, raise CliError when the verdict is not good."""
    if fail_over and not outcome.passed:
        failed = [check["name"] for check in outcome.result["checks"] if not check["passed"]]
        raise CliError(f"the verdict is not good: {', '.join(failed)}", FAILED)
