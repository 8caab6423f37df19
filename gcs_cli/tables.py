"""Tables on the terminal. rich is imported for the first table, because most commands print sentences alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_WIDE = 200
"""Columns of a table in a pipe or file."""


def new_table(**settings: Any) -> Table:
    """Return a table without a frame, to which columns and rows are added."""
    from rich import box
    from rich.table import Table

    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), **settings)


def table_console() -> Console:
    """Return the console of stdout, wide enough for a table if stdout is no terminal."""
    from rich.console import Console

    console = Console(emoji=False)
    return console if console.is_terminal else Console(width=_WIDE, emoji=False)
