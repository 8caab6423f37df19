"""The look that the three commands share: plain help, ``-h``, ``--version`` and shell completion."""

from __future__ import annotations

from typing import Annotated, Any

import typer

# the base of all complaints about usage, in typer with its own copy of click and without
UsageError: Any = typer.BadParameter.__mro__[1]

HELP_FLAGS = ("-h", "--help")


def make_app(**settings: Any) -> typer.Typer:
    """Return a command line whose help is plain text: brackets in it are brackets, not markup."""
    return typer.Typer(
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": list(HELP_FLAGS)},
        **settings,
    )


def _print_version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        from flightstack import __version__  # noqa: PLC0415

        print(f"{context.find_root().info_name} {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
]
