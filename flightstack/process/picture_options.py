"""The options of ``gcs replay`` and ``sim-bridge render``, which are the same: each with its type and its help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

Png = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write a picture: of the middle of the flight, or of --at."),
]
Sheet = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write nine moments, or those of --at, in one picture.")
]
Video = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a film, .mp4 (which needs even sizes) or .gif.")
]
View = Annotated[bool, typer.Option("--view", help="Play it in a window.")]
At = Annotated[
    str | None,
    typer.Option(metavar="T1[,T2,…]", help="Moments of the pictures, s; several give numbered files."),
]
Camera = Annotated[str, typer.Option(help="chase, fixed, top, side, or whole: all of the way from above.")]
Size = Annotated[
    str | None, typer.Option(metavar="WxH", help="Pixels.  [default: 1280x720; 480x270 for a gif]")
]
Fps = Annotated[float | None, typer.Option(help="Frames per second.  [default: 30; 12.5 for a gif]")]
Begin = Annotated[float | None, typer.Option("--from", help="Begin of the film, s.")]
End = Annotated[float | None, typer.Option("--to", help="End of the film, s.")]
Speed = Annotated[
    float | None, typer.Option(help="Show it so many times as fast as it was flown.  [default: 1]")
]
NoWords = Annotated[
    bool, typer.Option("--no-words", help="Leave out figures, numbers of places and the scale.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that exist already.")]


class PictureOptions(NamedTuple):
    """What was asked for, as it was given; None where it was not."""

    png: Path | None = None
    sheet: Path | None = None
    video: Path | None = None
    view: bool = False
    at: str | None = None
    camera: str = "chase"
    size: str | None = None
    fps: float | None = None
    begin: float | None = None
    end: float | None = None
    speed: float | None = None
    no_words: bool = False
    overwrite: bool = False

    def arguments(self) -> list[str]:
        """Return the command line that asks for the same."""
        given = {
            "--png": self.png, "--sheet": self.sheet, "--video": self.video, "--at": self.at,
            "--camera": self.camera, "--size": self.size, "--fps": self.fps, "--from": self.begin,
            "--to": self.end, "--speed": self.speed,
        }  # fmt: skip
        flags = {"--view": self.view, "--no-words": self.no_words, "--overwrite": self.overwrite}
        return [
            *(f"{flag}={value}" for flag, value in given.items() if value is not None),
            *(flag for flag, is_set in flags.items() if is_set),
        ]
