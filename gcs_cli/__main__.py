"""The command ``gcs``: the ground station on the command line."""

from __future__ import annotations

import signal
import sys

import typer

from flightstack.process.command_line import UsageError, Version, make_app
from flightstack.process.console import complain, drop, replace_unencodable
from gcs_cli.errors import DONE, FAILED, USAGE, CliError
from gcs_cli.settings import ConnectOption, InstanceOption, Settings, SigningKeyOption, TimeoutOption

app = make_app(
    name="gcs",
    help="Ground station on the command line: fly missions, command and watch a vehicle over MAVLink.",
    no_args_is_help=True,
)

_TYPER_INTERRUPTED = 130
"""What typer makes of a KeyboardInterrupt; none of our exit codes."""


@app.callback()
def options(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
    signing_key: SigningKeyOption = None,
    version: Version = False,  # its callback does all
) -> None:
    """Hold the flags that are given before the command."""
    context.obj = Settings(connect, timeout, signing_key, instance)


def _register() -> None:
    from gcs_cli.commands import (  # noqa: PLC0415
        actions,
        compare,
        fly,
        log,
        mission,
        paper,
        param,
        perf,
        pil,
        replay,
        status,
        watch,
    )

    app.command()(fly.fly)
    app.add_typer(mission.app, name="mission")
    app.add_typer(param.app, name="param")
    app.add_typer(log.app, name="log")
    app.add_typer(pil.app, name="pil")
    app.command()(paper.paper)
    for action in actions.ACTIONS:
        app.command()(action)
    app.command()(status.status)
    app.command()(watch.watch)
    app.command()(perf.perf)
    app.command()(replay.replay)
    app.command()(compare.compare)


_register()


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C: the terminal is restored
    replace_unencodable()
    try:
        code = app(argv, prog_name="gcs", standalone_mode=False) or DONE
        if sys.stdout is not None:
            sys.stdout.flush()
        if code != _TYPER_INTERRUPTED:
            return code
        sentence, code = "interrupted", FAILED
    except (KeyboardInterrupt, typer.Abort):
        sentence, code = "interrupted", FAILED
    except (BrokenPipeError, SystemExit):  # `gcs watch | head`, which typer ends itself
        drop(sys.stdout)
        return DONE
    except OSError as error:
        drop(sys.stdout)  # which may be what failed
        where = "" if error.filename is None else f"{error.filename}: "
        sentence, code = f"{where}{error.strerror or error}", FAILED
    except UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # `gcs` and `gcs mission`: its message is the help
            complain(error.format_message())
            return USAGE
        sentence, code = error.format_message(), USAGE
    except CliError as error:
        sentence, code = str(error), error.exit_code
    except Exception as error:
        sentence, code = _config_problem(error), USAGE
    complain(f"gcs: {sentence}")
    return code


def _config_problem(error: Exception) -> str:
    """Return the sentence of a bad file; raise all else again."""
    from flightstack.core.errors import ConfigError  # noqa: PLC0415

    if isinstance(error, ConfigError):
        return str(error)
    raise error


if __name__ == "__main__":
    sys.exit(main())
