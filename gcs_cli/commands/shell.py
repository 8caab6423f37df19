"""``gcs shell``: commands of ``gcs`` over one link, typed or from a script."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from flightstack.process.command_line import UsageError, expand_options, make_app
from flightstack.process.console import complain
from flightstack.process.interrupts import signals
from gcs_cli.commands.confirmation import kept_alive
from gcs_cli.errors import DONE, INTERRUPTED, USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import run_command
from gcs_cli.settings import LinkOptions, Settings, link_options, settings_of
from gcs_cli.vehicle_link import open_link

app = make_app(add_completion=False)

_ENDS = ("exit", "quit")
_HISTORY_LINES = 1000


@app.command()
@expand_options
def shell(
    context: typer.Context,
    link: LinkOptions,
    script: Annotated[Path | None, typer.Argument(metavar="[SCRIPT]", help="File of commands.")] = None,
    command: Annotated[
        list[str] | None, typer.Option("-c", metavar="COMMAND", help="Run this command; may be repeated.")
    ] = None,
) -> None:
    """Run commands over one link.

    Each line is a command without `gcs`; # begins a comment. A script, -c, or standard input that is no terminal ends
    at the first command that fails, with its exit code. A terminal has history and completion; `exit` or Ctrl-D ends.
    """
    if script is not None and command:
        raise CliError("shell: give a SCRIPT or -c, not both", USAGE)
    lines = _lines(script, command)
    with open_link(context, link, shares=True) as connection:
        connection.lend()
        try:
            runner = _Runner(context, connection, link)
            if lines is None:
                connection.wait_for(
                    lambda: connection.session.is_heard(connection.now_s),
                    link_options(context, link).timeout_s,
                )
            code = _interact(runner, connection) if lines is None else runner.run_all(lines)
        finally:
            connection.close()
    if code == INTERRUPTED:
        raise CliError("", INTERRUPTED)
    raise typer.Exit(code)


def _lines(script: Path | None, commands: list[str] | None) -> Iterable[str] | None:
    """Return the commands to run; None: they are typed."""
    if commands:
        return commands
    if script is not None:
        try:
            return script.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or "is no UTF-8 text"
            raise CliError(f"shell: {script}: cannot be read: {reason}", USAGE) from None
    return None if sys.stdin is not None and sys.stdin.isatty() else sys.stdin or ()


class _Runner:
    """Runs lines as commands of ``gcs`` over ``connection``."""

    def __init__(self, context: typer.Context, connection: Connection, link: LinkOptions) -> None:
        before = settings_of(context)
        timeout = link_options(context, link).timeout
        options = LinkOptions(timeout=timeout, as_json=before.link.as_json or link.as_json)
        self._settings = Settings(options, before.signing_key, connection)
        self.command: Any = context.find_root().command
        self._fleet = connection.fleet

    def run_all(self, lines: Iterable[str]) -> int:
        """Run lines until one fails; return its exit code."""
        for line in lines:
            code = self.run(line)
            if code != DONE:
                return code
        return DONE

    def run(self, line: str) -> int:
        """Run one line; print its error and return its exit code."""
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            complain(f"gcs: {line.strip()}: {str(error).lower()}")
            return USAGE
        if not words:
            return DONE
        if words[0] == "gcs":
            words = words[1:]
        if words[:1] == ["shell"]:
            complain("gcs: shell: runs already")
            return USAGE
        as_json = "--json" in words or self._settings.link.as_json
        selection = self._fleet.selection
        try:
            return run_command(
                lambda: self.command.main(
                    args=words, prog_name="gcs", standalone_mode=False, obj=self._settings
                ),
                as_json,
            )
        finally:
            self._fleet.selection = selection


def _interact(runner: _Runner, connection: Connection) -> int:
    with _line_editing(runner.command):
        while True:
            try:
                prompt = _prompt(connection)  # before another thread uses the connection
                with kept_alive(connection):
                    line = input(prompt)
            except EOFError:
                print()
                return DONE
            except KeyboardInterrupt:
                print()
                continue
            if line.strip() in _ENDS:
                return DONE
            runner.run(line)
            signals.reported = False  # by that command


def _prompt(connection: Connection) -> str:
    view = connection.session.view
    if view.identity is None:
        return "gcs> "
    state = (
        "lost"
        if view.lost(connection.now_s)
        else f"{view.mode or ''} {'armed' if view.armed else 'disarmed'}"
    )
    return f"{view.identity.system_id} {state}> "


@contextlib.contextmanager
def _line_editing(command: Any) -> Iterator[None]:
    """Edit lines with history and completion, where Python has readline."""
    try:
        import readline
    except ImportError:
        yield
        return
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    history = Path(state).expanduser() / "gcs" / "history"
    with contextlib.suppress(OSError):
        readline.read_history_file(history)
    readline.set_history_length(_HISTORY_LINES)
    readline.set_completer_delims(" \t\n")
    readline.set_completer(_Completer(command, readline.get_line_buffer, readline.get_begidx).complete)
    readline.parse_and_bind(
        "bind ^I rl_complete" if "libedit" in (readline.__doc__ or "") else "tab: complete"
    )
    try:
        yield
    finally:
        readline.set_completer(None)
        with contextlib.suppress(OSError):
            history.parent.mkdir(parents=True, exist_ok=True)
            readline.write_history_file(history)


class _Completer:
    """Completes commands, options and values by the shell completion of the command line."""

    def __init__(self, command: Any, line: Any, begin: Any) -> None:
        # typer has its own copy of Click in some versions
        module = import_module(f"{UsageError.__module__.rpartition('.')[0]}.shell_completion")
        unused = dict.fromkeys(("source_vars", "get_completion_args", "format_completion"))
        kind = type("_WordCompletion", (module.ShellComplete,), unused)
        self._shell = kind(command, {}, "gcs", "_GCS_COMPLETE")
        self._line = line
        self._begin = begin
        self._found: list[str] = []

    def complete(self, text: str, number: int) -> str | None:
        """Return the completion with this number; None after the last one."""
        if number == 0:
            self._found = self.completions(self._line()[: self._begin()], text)
        return self._found[number] if number < len(self._found) else None

    def completions(self, before: str, text: str) -> list[str]:
        """Return the words that may stand after ``before`` and begin with ``text``."""
        try:
            words = shlex.split(before)
        except ValueError:  # an open quotation
            return []
        items = self._shell.get_completions(words, text)
        return [f"{item.value} " for item in items if item.type == "plain"]
