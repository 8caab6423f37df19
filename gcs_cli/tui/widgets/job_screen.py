"""A screen that exchanges data with the vehicle and with files, one job at a time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from rich.text import Text

from flightstack.core.enums import Severity
from flightstack.core.errors import ConfigError
from gcs_cli.errors import CliError
from gcs_cli.link.connection import Connection
from gcs_cli.tui.orders.form import Confirm
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.tui.widgets.entry_form import Entry, EntryForm, PathSuggester

Value = TypeVar("Value")
_MOST_LINES = 10


class JobScreen(WatchScreen):
    """Runs jobs in the thread of the link; results become toasts and messages."""

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self.doing = ""
        """The current job, in words; empty: none."""
        self.progress = (0, 0)
        """Transferred units of the current job and their total; 0: unknown."""

    @property
    def is_working(self) -> bool:
        """True if an action of this screen has not ended: a job, or a question that may begin one."""
        return any(worker.node is self and not worker.is_finished for worker in self.workers)

    @property
    def doing_text(self) -> str:
        """The current job with its progress."""
        done, total = self.progress
        return f"{self.doing}: {done} of {total}" if total else self.doing

    def show_progress(self, done: int, total: int) -> None:
        """Store the progress of a job. Called in the thread of the link."""
        self.progress = (done, total)

    async def run_job(
        self,
        doing: str,
        job: Callable[[Connection], Value],
        system_id: int | None,
        *,
        ends_in_order: bool = False,
        failure: str = "",
    ) -> Value | None:
        """Return the result of a job on the vehicle with this system id; see ``Feed.submit``.

        None if it failed, if another vehicle is selected, or if another job has not ended: the reason is shown,
        after ``failure``.
        """
        if self.doing:
            self.notify(f"{self.doing} has not ended", severity="warning")
            return None
        self.doing, self.progress = doing, (0, 0)
        app = watch_app(self)
        feed, unsaved = app.feed, f"{self.mode} job"
        app.unsaved[unsaved] = f"{doing.capitalize()} has not ended."
        try:
            return await asyncio.wrap_future(feed.submit(job, system_id, ends_in_order=ends_in_order))
        except (CliError, ConfigError) as error:
            feed.tell(f"{failure}: {error}" if failure else str(error), Severity.ERROR)
            return None
        finally:
            self.doing = ""
            app.unsaved.pop(unsaved, None)

    async def ask(self, question: str, yes: str) -> bool:
        """Return True if the user agrees."""
        agrees: bool = await self.app.push_screen_wait(Confirm(question, yes))
        return agrees

    async def ask_file(self, title: str, value: str, suffixes: Sequence[str], *, is_new: bool) -> Path | None:
        """Return the path of a file that the user types; ask before an existing one is replaced."""

        def parse(texts: list[str]) -> Path:
            path = Path(texts[0]).expanduser()
            if not texts[0] or path.is_dir():
                raise ValueError("give the path of a file")
            if not is_new and not path.exists():
                raise ValueError(f"{path}: no such file")
            if is_new and suffixes and path.suffix.lower() not in suffixes:
                raise ValueError(f"the suffix must be one of {', '.join(suffixes)}")
            return path

        form = EntryForm(title, [Entry("file", value, PathSuggester(suffixes))], parse)
        path: Path | None = await self.app.push_screen_wait(form)
        if (
            path is not None
            and is_new
            and path.exists()
            and not await self.ask(f"Replace {path}?", "Replace")
        ):
            return None
        return path

    def attempt(self, action: Callable[[], Value]) -> Value | None:
        """Return the result of ``action`` on a file; None if it failed: the reason is shown."""
        try:
            return action()
        except (CliError, ConfigError) as error:
            watch_app(self).feed.tell(str(error), Severity.ERROR)
        except OSError as error:
            watch_app(self).feed.tell(f"{error.filename}: {error.strerror}", Severity.ERROR)
        return None

    def show_line(self, id: str, left: Text, right: Text) -> None:
        """Show two texts in a line, at its ends; the left one is cut if they do not fit."""
        line = self.query_one(f"#{id}", LineWidget)
        room = max(0, line.content_size.width - len(right) - 1)
        left = left.copy()
        left.truncate(room, overflow="ellipsis", pad=True)
        line.show_line(left.append(" ").append_text(right))


def some_of(lines: Sequence[str]) -> str:
    """Return the first lines, and how many follow."""
    more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    return "\n".join([*lines[:_MOST_LINES], *more])
