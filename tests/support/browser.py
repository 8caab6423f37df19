"""A headless Chromium, driven by the DevTools protocol."""

from __future__ import annotations

import base64
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
BINARY = 2
"""Opcode of a frame with bytes, which DevTools reports in base64."""


class Page:
    """One page."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._frames = b""
        """What the page's own WebSocket received, after ``Network.enable``."""

    async def _receive(self) -> dict[str, Any]:
        message: dict[str, Any] = json.loads(await self._socket.receive_str(timeout=HANG_S))
        if message.get("method") == "Network.webSocketFrameReceived":
            frame = message["params"]["response"]
            data = frame["payloadData"]
            self._frames += base64.b64decode(data) if frame["opcode"] == BINARY else data.encode()
        return message

    async def wait_for_frame(self, text: str) -> None:
        """Wait until the page's WebSocket has received ``text`` since the last wait."""
        while text.encode() not in self._frames:
            await self._receive()
        self._frames = self._frames.partition(text.encode())[2]

    async def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the result of a DevTools method."""
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": params})
        while True:
            answer = await self._receive()
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

    async def type(self, text: str) -> None:
        """Type into the terminal of the page."""
        await self.value("document.querySelector('textarea').focus()")
        await self.call("Input.insertText", text=text)


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
    """Open a page; return its WebSocket address."""
    request = urllib.request.Request(f"{devtools}/json/new?about:blank", method="PUT")
    with urllib.request.urlopen(request, timeout=HANG_S) as answer:
        return str(json.load(answer)["webSocketDebuggerUrl"])
