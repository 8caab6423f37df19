"""Run a command and turn its errors into one sentence and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable

import typer

from flightstack.core.errors import ConfigError
from flightstack.process.command_line import UsageError, usage_sentence
from flightstack.process.console import complain, drop, say
from gcs_cli.errors import DONE, FAILED, USAGE, CliError
from gcs_cli.output import error_line

_TYPER_INTERRUPTED = 130
"""Exit code of typer for a KeyboardInterrupt; not one of ours."""


def run_command(run: Callable[[], int | None], as_json: bool) -> int:
    """Run a command; return its exit code. With ``as_json``, an error is also a JSON object on stdout."""
    try:
        code = run() or DONE
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
    if as_json:
        say(error_line(sentence, code))
    return code
