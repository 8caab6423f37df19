"""The process in which a client's library runs: it connects, then runs stories by name, one a line of input.

It is started by :class:`tests.interop.client.Client`; a library that hangs or dies then cannot take the tests along.
"""

from __future__ import annotations

import asyncio
import importlib
import json
import sys
import traceback

import pytest

from tests.interop.drone import Drone

CONNECTED, PASSED, FAILED = (f"[{word}]" for word in ("connected", "passed", "failed"))
"""Words to the parent. MAVSDK writes to the same output, in pieces: a word may stand anywhere in a line."""


def say(word: str) -> None:
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


async def serve(url: str) -> None:
    drone = await Drone.connect(url)
    say(CONNECTED)
    loop = asyncio.get_running_loop()
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        module, function, arguments = json.loads(line)
        try:
            await getattr(importlib.import_module(module), function).story(drone, **arguments)
        except (Exception, pytest.fail.Exception):
            traceback.print_exc()
            say(FAILED)
        else:
            say(PASSED)
    drone.mavsdk.destroy()


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1]))
