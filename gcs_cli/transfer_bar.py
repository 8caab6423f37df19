"""A bar for a transfer: on a terminal only, where something waits to see it."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)


class TransferBar:
    """Shows how far a transfer is; leaves nothing behind on the terminal."""

    def __init__(self, name: str, console: Console | None = None) -> None:
        console = console or Console(stderr=True)
        draws = console.is_terminal and not console.is_dumb_terminal
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            DownloadColumn(),
            TransferSpeedColumn(),
            TimeRemainingColumn(),
            console=console,
            disable=not draws,
            transient=True,
        )
        self._task = self._progress.add_task(name, total=None)

    def show(self, done: int, total: int) -> None:
        """Show ``done`` of ``total`` bytes; a total of 0 is not known yet."""
        self._progress.update(self._task, completed=done, total=total or None)

    def __enter__(self) -> TransferBar:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()
