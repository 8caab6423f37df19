"""Command groups that import a command's module when the command is used.

Help and completion of command names use the summaries alone, so that they import no command.
See "Lazily Loading Subcommands" in Click's documentation.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, ClassVar, NamedTuple

from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from flightstack.process import collection
from gcs_cli.commands.examples import epilog


class LazyCommand(NamedTuple):
    """A command of the Typer app ``app`` in ``module``."""

    module: str
    summary: str
    """The line in the list of commands; equal to the first sentence of the command's help."""
    hidden: bool = False
    """True for a former name, which the list leaves out."""
    app: str = "app"

    def load(self, words: str) -> Any:
        """Import the module and return the Click command, named by its ``words``, such as ``mission upload``."""
        with collection.paused():
            module = import_module(self.module)
        loaded = get_command(getattr(module, self.app))
        command = loaded.commands[words.rsplit(maxsplit=1)[-1]] if isinstance(loaded, TyperGroup) else loaded
        command.epilog = epilog(words)
        return command


class LazyGroup(TyperGroup):
    """A group whose commands, ``lazy``, are listed before those that are added to it."""

    lazy: ClassVar[Mapping[str, LazyCommand]] = {}

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        listed = {
            name: TyperCommand(name, help=command.summary, hidden=command.hidden)
            for name, command in self.lazy.items()
        }
        self.commands = {**listed, **self.commands}

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[Any, Any, list[str]]:
        """Return name, command and remaining arguments; import the command's module."""
        name, command, rest = super().resolve_command(ctx, args)
        if name is not None and name in self.lazy:
            group = ctx.command_path.split()[1:]
            command = self.lazy[name].load(" ".join((*group, name)))
        return name, command, rest
