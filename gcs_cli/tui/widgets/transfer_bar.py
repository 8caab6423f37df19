"""Progress bar of a transfer, on a terminal only."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)


class TransferBar:
    """Shows the progress of a transfer, and removes itself at the end."""

    def __init__(
        self, name: str, console: Console | None = None, columns: Sequence[ProgressColumn] = ()
    ) -> None:
        """Show ``columns`` after the bar; by default bytes and their rate."""
        console = console or Console(stderr=True, emoji=False)
        draws = console.is_terminal and not console.is_dumb_terminal
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            *(columns or (DownloadColumn(), TransferSpeedColumn())),
            TimeRemainingColumn(),
            console=console,
            disable=not draws,
            transient=True,
        )
        self._task = self._progress.add_task(name, total=None)

    def show(self, done: int, total: int) -> None:
        """Show ``done`` of ``total``; a total of 0 is unknown."""
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


def step_bar(name: str, console: Console) -> TransferBar:
    """Return a bar that counts steps instead of bytes."""
    return TransferBar(name, console, (MofNCompleteColumn(),))
