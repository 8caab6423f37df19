"""Output of ``sim-bridge render``: pictures, a sheet of pictures, or a film of a flight."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import NamedTuple

from PIL import Image
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody.frames import flip_vector
from sim_bridge.render.cameras import SCALED
from sim_bridge.render.film import frames_to_draw, sheet, write_film, write_png
from sim_bridge.render.overlay import Label, Overlay
from sim_bridge.render.poses import FlightPath
from sim_bridge.render.renderer import Renderer

_FASTEST_RAD_S = 1e4
SHEET_PICTURES = 9
_MANY, _LONG_S = 60, 45.0


class PictureStyle(NamedTuple):
    """Camera, size and overlay of pictures."""

    camera: str
    width: int
    height: int
    overlay: bool = True


class Film(NamedTuple):
    """A film of ``frames`` pictures from ``begin_s`` on, ``step_s`` of flight time apart."""

    path: Path
    begin_s: float
    step_s: float
    frames: int
    fps: float


def film_of(path: Path, begin_s: float, end_s: float, fps: float, speed: float) -> Film:
    """Return the film of a part of the flight at ``speed`` times its real speed."""
    count = max(1, math.floor((end_s - begin_s) / speed * fps + 0.5))
    return Film(path, begin_s, speed / fps, count, fps)


def numbered(path: Path, count: int) -> list[Path]:
    """Return file names for ``count`` pictures; several get -1, -2 … before the suffix."""
    if count == 1:
        return [path]
    digits = len(str(count))
    return [path.with_name(f"{path.stem}-{number:0{digits}}{path.suffix}") for number in range(1, count + 1)]


def spread(begin_s: float, end_s: float, count: int) -> list[float]:
    """Return ``count`` equidistant times from ``begin_s`` to ``end_s``."""
    return [begin_s + (end_s - begin_s) * index / max(1, count - 1) for index in range(count)]


def announcement(film: Film, seconds: float) -> str:
    """Return the notice before a film that takes long to render, else an empty string."""
    if seconds < _LONG_S:
        return ""
    return (
        f"{film.path.name}: {film.frames} frames, about {max(1, round(seconds / 60.0))} min; "
        "--from, --to, --size and --fps reduce the time"
    )


class Pictures:
    """Draws the pictures of one flight, with progress on a terminal. Raises UsageProblemError."""

    def __init__(self, vehicle: Vehicle, path: FlightPath, style: PictureStyle) -> None:
        self._path, self._style = path, style
        self._renderer = Renderer(vehicle, path, style.width, style.height)
        fastest = [min(rotor.max_speed_rad_s, _FASTEST_RAD_S) for rotor in vehicle.rotors]
        labels = [
            Label(name, flip_vector(at))
            for name, at in zip(path.waypoint_names(), path.poses.waypoints_ned_m.tolist(), strict=True)
        ]
        title = path.poses.title or vehicle.name
        self._overlay = Overlay(title, fastest, style.width, style.height, labels)
        console = Console(stderr=True, emoji=False)
        self._progress = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
            console=console, transient=True, disable=not console.is_terminal or console.is_dumb_terminal,
        )  # fmt: skip
        self._task = self._progress.add_task("pictures", total=None)

    def at(self, time_s: float) -> Image.Image:
        """Return the picture at a time."""
        moment = self._path.at(time_s)
        camera = self._style.camera
        picture = self._renderer.draw(moment, camera)
        self._progress.advance(self._task)
        if not self._style.overlay:
            return Image.fromarray(picture)
        return self._overlay.write(picture, moment, self._renderer.view(moment, camera), camera in SCALED)

    def write_pngs(self, path: Path, times_s: list[float]) -> list[Path]:
        """Write a picture for each time; return the files. Raises OSError."""
        self._begin(path.name, len(times_s))
        paths = numbered(path, len(times_s))
        for file, time_s in zip(paths, times_s, strict=True):
            write_png(file, self.at(time_s))
        return paths

    def write_sheet(self, path: Path, times_s: list[float]) -> None:
        """Write one picture with several times. Raises OSError."""
        self._begin(path.name, len(times_s))
        write_png(path, sheet([self.at(time_s) for time_s in times_s]))

    def write_film(self, film: Film) -> None:
        """Write a film. Raises OSError."""
        drawn = frames_to_draw(film.path, film.frames)
        self._begin(film.path.name, drawn)
        self._announce(film, drawn)
        write_film(
            film.path, lambda index: self.at(film.begin_s + index * film.step_s), film.frames, film.fps
        )

    def _announce(self, film: Film, drawn: int) -> None:
        """Print the estimated time of a long film, so that the user can request a shorter one."""
        if drawn < _MANY:
            return
        self.at(film.begin_s)  # the first picture also initialises the renderer
        begun = time.perf_counter()
        self.at(film.begin_s)
        sentence = announcement(film, drawn * (time.perf_counter() - begun))
        self._progress.update(self._task, completed=0)
        if sentence:
            self._progress.console.print(sentence, highlight=False, soft_wrap=True)

    def _begin(self, name: str, total: int) -> None:
        self._progress.reset(self._task, total=total, description=name)

    def __enter__(self) -> Pictures:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        self._renderer.close()
