"""The terminal view in a browser: textual-serve, with a page that loads nothing from the network.

A module of its own: only ``--serve`` imports its libraries.
"""

from __future__ import annotations

import asyncio
import shlex
import signal
from pathlib import Path

import typer
from aiohttp import web
from textual_serve.server import Server

from gcs_cli.link.endpoint import LOOPBACK

_LOOPBACK_NAMES = (LOOPBACK, "localhost", "[::1]")


class WatchServer(Server):
    """Runs ``command`` for each browser that connects; pages of other origins are refused."""

    def __init__(self, command: list[str], host: str, port: int) -> None:
        super().__init__(
            shlex.join(command), host, port, title="gcs watch", templates_path=Path(__file__).parent / "page"
        )
        names = _LOOPBACK_NAMES if host in _LOOPBACK_NAMES else (host,)
        self._origins = {f"http://{name}:{port}" for name in names}

    async def on_startup(self, app: web.Application) -> None:
        """Print no banner."""

    def serve(self, debug: bool = False) -> None:
        """Serve until SIGINT or SIGTERM; print the address once browsers can connect."""
        loop = asyncio.new_event_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.request_exit)
        web.run_app(
            self._make_app(),
            host=self.host,
            port=self.port,
            handle_signals=False,
            loop=loop,
            print=lambda *_: typer.echo(f"serving at {self.public_url}: Ctrl-C ends"),
        )

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """Serve a page of ours; a foreign page in the same browser must not command the vehicle."""
        if request.headers.get("Origin") not in self._origins:
            raise web.HTTPForbidden(text="open this address itself")
        return await super().handle_websocket(request)
