"""A headless Chromium, driven by the DevTools protocol."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

from tests.support.tools import missing

HANG_S = 120.0


class Page:
    """One page."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)

    async def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the result of a DevTools method."""
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": params})
        while True:
            answer = json.loads(await self._socket.receive_str(timeout=HANG_S))
            if answer.get("id") == number:
                return answer["result"]

    async def value(self, script: str) -> Any:
        """Return the value of a JavaScript expression."""
        result = await self.call("Runtime.evaluate", expression=script, returnByValue=True)
        return result["result"].get("value")

    async def wait(self, script: str) -> None:
        """Wait until a JavaScript expression is true; the limit is for a hang only."""
        end_s = time.monotonic() + HANG_S
        while not await self.value(script):
            assert time.monotonic() < end_s, script

    async def press(self, key: str) -> None:
        """Type a character."""
        await self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=key)
        await self.call("Input.dispatchKeyEvent", type="keyUp", key=key)


@contextmanager
def chromium(folder: Path) -> Iterator[str]:
    """Run Chromium with its profile in ``folder``; yield the address of its DevTools. Skip without it."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        missing("chromium is not installed")
    process = subprocess.Popen(
        [
            program, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
            f"--user-data-dir={folder}", "--window-size=1200,800", "about:blank",
        ],
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "DevTools listening on ws://" in line)
        yield "http://" + line.split("ws://")[1].split("/")[0]
    finally:
        process.terminate()
        process.communicate()


def page_socket(devtools: str) -> str:
    """Return the WebSocket address of the first page."""
    with urllib.request.urlopen(f"{devtools}/json/list", timeout=HANG_S) as answer:
        pages = [target for target in json.load(answer) if target["type"] == "page"]
    return str(pages[0]["webSocketDebuggerUrl"])
