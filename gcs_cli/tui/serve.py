"""The terminal view in a browser: textual-serve, with a page that loads nothing from the network."""

from __future__ import annotations

import shlex
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

    def initialize_logging(self) -> None:
        """Log nothing: the address is printed at the start."""

    async def on_startup(self, app: web.Application) -> None:
        """Print the address."""
        typer.echo(f"serving at {self.public_url}: Ctrl-C ends")

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """Serve a page of ours; a foreign page in the same browser must not command the vehicle."""
        if request.headers.get("Origin") not in self._origins:
            raise web.HTTPForbidden(text="open this address itself")
        return await super().handle_websocket(request)
