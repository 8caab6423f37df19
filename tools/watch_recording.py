"""Write the recording of ``gcs watch`` in docs/images: ``python -m tools.watch_recording LINK``.

The vehicle is on the ground with a mission, for example that of ``gcs sim`` after ``gcs mission upload``. Chromium
draws the pictures, Pillow joins them.
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from textual.pilot import Pilot

from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.feed import Feed
from tools.generated import ROOT
from tools.watch_picture import picture_of

RECORDING = ROOT / "docs" / "images" / "watch.gif"
SIZE = (100, 30)
PICTURE_S = 1.0
SHOWN_MS = 600
COLOURS = 48
PIXELS = (920, 574)
"""Size of a picture, with the proportions of a screen of ``SIZE``."""
STORY = (
    ("C",),
    ("y",),
    (),
    (),
    (),
    ("2",),
    (),
    (),
    (),
    ("3",),
    (),
    (),
    ("4",),
    (),
    (),
    ("7",),
    (),
    ("1",),
    (),
    (),
)
"""Keys before each picture."""


async def record(app: WatchApp, pilot: Pilot[object], folder: Path) -> list[Path]:
    """Press the keys of the story, and return the pictures."""
    await asyncio.sleep(2 * PICTURE_S)
    pictures = []
    for number, keys in enumerate(STORY):
        await pilot.press(*keys)
        await asyncio.sleep(PICTURE_S)
        pictures.append(folder / f"{number:02d}.svg")
        pictures[-1].write_text(picture_of(app), encoding="utf-8")
    return pictures


def draw(pictures: list[Path], folder: Path) -> list[Image.Image]:
    """Return the pictures as pixels, drawn as one page."""
    width, height = PIXELS
    images = "".join(f'<img src="{path.name}" width="{width}" height="{height}">' for path in pictures)
    (folder / "page.html").write_text(f"<style>body {{ margin: 0 }} img {{ display: block }}</style>{images}")
    subprocess.run(
        [
            "chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile",
            f"--screenshot={folder}/page.png", f"--window-size={width},{height * len(pictures)}",
            f"file://{folder}/page.html",
        ],
        check=True,
        capture_output=True,
    )  # fmt: skip
    page = Image.open(folder / "page.png").convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    tops = range(0, height * len(pictures), height)
    return [page.crop((0, top, width, top + height)) for top in tops]


def main() -> None:
    """Fly the mission of the vehicle and write what the screens show."""
    with tempfile.TemporaryDirectory() as name, Connection(parse_endpoint(sys.argv[1])) as connection:
        app = WatchApp(Feed(connection))
        pictures: list[Path] = []

        async def take(pilot: Pilot[object]) -> None:
            pictures.extend(await record(app, pilot, Path(name)))
            app.exit()

        app.run(headless=True, size=SIZE, auto_pilot=take)
        first, *others = draw(pictures, Path(name))
        first.save(RECORDING, save_all=True, append_images=others, duration=SHOWN_MS, loop=0, optimize=False)


if __name__ == "__main__":
    main()
