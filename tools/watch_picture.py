"""Write the picture of ``gcs watch`` in docs/images from a vehicle that flies: ``python -m tools.watch_picture LINK``.

For example beside ``gcs sim``, after ``gcs mission upload`` and ``gcs mission start``.
"""

from __future__ import annotations

import asyncio
import re
import sys

from textual.pilot import Pilot

from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.feed import Feed
from tools.generated import ROOT

PICTURE = ROOT / "docs" / "images" / "watch.svg"
SIZE = (120, 35)
WAIT_S = 8.0


def picture_of(app: WatchApp) -> str:
    """Return the screen as SVG, without references to fonts on the network."""
    return re.sub(r"@font-face \{.*?\}\s*", "", app.export_screenshot(), flags=re.DOTALL)


def main() -> None:
    """Watch for some seconds, then write the picture."""
    with Connection(parse_endpoint(sys.argv[1])) as connection:
        app = WatchApp(Feed(connection))

        async def take(_pilot: Pilot[object]) -> None:
            await asyncio.sleep(WAIT_S)
            PICTURE.write_text(picture_of(app), encoding="utf-8")
            app.exit()

        app.run(headless=True, size=SIZE, auto_pilot=take)


if __name__ == "__main__":
    main()
