"""Output of a command: sentences or JSON lines of its result, and the sentence and exit code of its end."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from flightstack.core.errors import ConfigError, WriteError
from flightstack.process.command_line import UsageError, usage_sentence
from flightstack.process.console import check_output, complain, drop, say
from flightstack.process.interrupts import signals
from gcs_cli.errors import DONE, FAILED, INTERRUPTED, USAGE, CliError


class Output:
    """Prints each fact as a sentence, or with ``as_json`` as one JSON object a line, flushed at once."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json

    def say(self, event: str, sentence: str, **facts: Any) -> None:
        """Print ``sentence``, or ``{"event": event, ...facts}``: SI units, degrees, null for unknown values."""
        if self.as_json:
            typer.echo(json.dumps({"event": event, **plain(facts)}, allow_nan=False))
        else:
            typer.echo(sentence)


def error_line(sentence: str, exit_code: int) -> str:
    """Return the JSON object of an error that ended a command."""
    return json.dumps({"event": "error", "message": sentence, "exit_code": exit_code})


def plain(value: Any) -> Any:
    """Return ``value`` as JSON can hold it: NumPy's numbers as Python's, NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, str | bytes):
        return value if isinstance(value, str) else value.hex()
    if isinstance(value, Sequence) or hasattr(value, "tolist"):
        listed = value.tolist() if hasattr(value, "tolist") else value
        return [plain(entry) for entry in listed] if isinstance(listed, Sequence) else plain(listed)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def show_page(page: Path) -> None:
    """Show a page in the user's browser; without one, say on stderr where the page is."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        complain(f"gcs: --open: there is no browser; the page is {page}")


def can_draw() -> bool:
    """Return True if the output is a terminal that can draw, or a browser of textual-serve."""
    if "TEXTUAL_DRIVER" in os.environ:
        return True
    return (
        sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
    )


def run_command(run: Callable[[], int | None], as_json: bool) -> int:
    """Run a command; return its exit code. With ``as_json``, an error is also a JSON object on stdout."""
    try:
        code = run() or DONE
        check_output()
        if code != INTERRUPTED:  # typer's code for a KeyboardInterrupt; our commands raise CliError with it
            return code
        sentence, code = "interrupted", INTERRUPTED
    except (KeyboardInterrupt, typer.Abort):
        sentence, code = "interrupted", INTERRUPTED
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
        sentence, code = str(error), FAILED if isinstance(error, WriteError) else USAGE
    signals.reported = True  # a second one neither replaces nor repeats the sentence
    if not sentence:
        return code
    complain(f"gcs: {sentence}")
    if as_json:
        say(error_line(sentence, code))
    return code
