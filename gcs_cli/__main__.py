"""The command ``gcs``: the ground station on the command line."""

from __future__ import annotations

import signal
import sys

import typer

from flightstack.core.errors import ConfigError
from flightstack.process.command_line import UsageError, Version, expand_options, make_app, usage_sentence
from flightstack.process.console import complain, drop, replace_unencodable, say
from gcs_cli.commands.registry import GcsGroup, add_groups
from gcs_cli.errors import DONE, FAILED, USAGE, CliError
from gcs_cli.output import error_line
from gcs_cli.settings import LinkOptions, Settings, SigningKeyOption

app = make_app(
    name="gcs",
    cls=GcsGroup,
    help="Ground station on the command line: fly missions, command and watch a vehicle over MAVLink.",
    no_args_is_help=True,
)
add_groups(app)

_TYPER_INTERRUPTED = 130
"""Exit code of typer for a KeyboardInterrupt; not one of ours."""


@app.callback()
@expand_options
def options(
    context: typer.Context,
    link: LinkOptions,
    signing_key: SigningKeyOption = None,
    version: Version = False,  # its callback does all
) -> None:
    """Keep the options that are given before the command."""
    context.obj = Settings(link, signing_key)


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code.

    An error is one sentence on stderr; with ``--json`` it is also an object on stdout.
    """
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
        sentence, code = usage_sentence(error), USAGE
    except CliError as error:
        sentence, code = str(error), error.exit_code
    except ConfigError as error:
        sentence, code = str(error), USAGE
    complain(f"gcs: {sentence}")
    if "--json" in (sys.argv[1:] if argv is None else argv):
        say(error_line(sentence, code))
    return code


if __name__ == "__main__":
    sys.exit(main())
