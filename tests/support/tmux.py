"""A program in a terminal of tmux: keys in, the screen as a person sees it out.

tmux runs in control mode: it reports each output of the program, so that waiting needs no clock.
"""

from __future__ import annotations

import os
import select
import shlex
import shutil
import subprocess
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.support.tools import missing

HANG_S = 120.0
OWN_REPLY = "1"
"""Last field of %begin and %end around the reply to a command of this client."""


class Terminal:
    """A running program; ``screen`` is its text."""

    def __init__(self, tmux: subprocess.Popen[bytes]) -> None:
        self._tmux = tmux
        self._unread = b""
        self._told: deque[str] = deque(maxlen=40)  # for the message of a failure
        self.ended = False

    def _line(self) -> str:
        """Return the next line of tmux; empty after its end."""
        assert self._tmux.stdout is not None
        while b"\n" not in self._unread:
            assert select.select([self._tmux.stdout], [], [], HANG_S)[0], "\n".join(
                ("no output after:", *self._told)
            )
            more = os.read(self._tmux.stdout.fileno(), 65536)
            if not more:
                self.ended = True
                return ""
            self._unread += more
        line, _, self._unread = self._unread.partition(b"\n")
        self._told.append(line.decode(errors="replace"))  # an output may end within a character
        return self._told[-1]

    def wait_for_session(self) -> None:
        """Wait until the session exists: a command before it has no target."""
        while not self._line().startswith("%session-changed"):
            assert not self.ended, "\n".join(("no session:", *self._told))

    def _call(self, *words: object) -> list[str]:
        """Return the reply to a command of tmux."""
        assert self._tmux.stdin is not None
        self._tmux.stdin.write(shlex.join(map(str, words)).encode() + b"\n")
        self._tmux.stdin.flush()
        reply: list[str] | None = None
        while not self.ended:
            line = self._line()
            if line.startswith(("%begin", "%end", "%error")) and line.endswith(OWN_REPLY):
                if reply is not None:
                    assert not line.startswith("%error"), "\n".join((*reply, "after:", *self._told))
                    return reply
                reply = []
            elif reply is not None:
                reply.append(line)
        return []

    @property
    def screen(self) -> str:
        """The text on the screen, without trailing blanks."""
        return "\n".join(self._call("capture-pane", "-p"))

    @property
    def sizes(self) -> str:
        """Columns and lines of the pane, and lines and columns that its programs read."""
        pane, tty = self._call("display-message", "-p", "#{pane_width}x#{pane_height} #{pane_tty}")[0].split()
        told = subprocess.run(["stty", "size", "-F", tty], capture_output=True, text=True, check=False)
        return f"{pane}, told {told.stdout.strip()}"

    @property
    def coloured(self) -> str:
        """The text on the screen with the escape sequences of its colours."""
        return "\n".join(self._call("capture-pane", "-p", "-e"))

    def wait(self, *texts: str, without: str = "\0") -> str:
        """Return the screen when it has all ``texts`` and not ``without``."""
        return self.wait_until(
            lambda shown: all(text in shown for text in texts) and without not in shown, str(texts)
        )

    def wait_until(self, holds: Callable[[str], object], what: str) -> str:
        """Return the screen when ``holds`` is true of it; look at it after each output."""
        end_s = time.monotonic() + HANG_S
        while not holds(shown := self.screen):
            assert time.monotonic() < end_s, f"never {what} in {self.sizes}:\n{shown}"
            while not self._line().startswith("%output"):
                assert not self.ended, "\n".join((f"ended without {what} after:", *self._told))
        return shown

    def press(self, *keys: str) -> None:
        """Press keys by tmux's names, such as ``Enter``, ``C-p`` or ``A``."""
        self._call("send-keys", *keys)

    def type(self, text: str) -> None:
        """Type a text."""
        self._call("send-keys", "-l", text)

    def resize(self, width: int, height: int) -> None:
        """Change the size of the window."""
        self._call("resize-window", "-x", width, "-y", height)

    def wait_for_end(self) -> None:
        """Wait until the program has ended."""
        while not self.ended:
            self._line()


@contextmanager
def terminal(
    command: Sequence[str], folder: Path, size: tuple[int, int] = (120, 35), **environment: str
) -> Iterator[Terminal]:
    """Run ``command`` in ``folder`` on a terminal of ``size`` cells; skip without tmux."""
    if shutil.which("tmux") is None:
        missing("tmux is not installed")
    with tempfile.TemporaryDirectory(prefix="tmux-") as sockets:
        tmux = ["tmux", "-f", os.devnull, "-S", f"{sockets}/socket"]
        width, height = map(str, size)
        words = ["-C", "new-session", "-x", width, "-y", height, "-c", str(folder), shlex.join(command)]
        client = subprocess.Popen(
            [*tmux, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor", **environment},
        )
        try:
            made = Terminal(client)
            made.wait_for_session()
            made.resize(*size)
            yield made
        finally:
            subprocess.run([*tmux, "kill-server"], check=False, capture_output=True)
            client.communicate()
