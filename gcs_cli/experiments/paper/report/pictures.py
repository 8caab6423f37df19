"""Pictures of the multibody vehicle in flight for the report, rendered by ``sim-bridge render``."""

from __future__ import annotations

import base64
import subprocess
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.core.geometry_bulk import quaternions_from_euler
from flightstack.flight_log.poses_file import Poses, write_poses
from flightstack.process.supervised import own_program
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.flights.types import Recording

SIZE = "960x540"
"""Twice the width on the page."""
RENDER_TIMEOUT_S = 180.0
"""Timeout of the renderer; software rendering of a picture takes 0.1 s."""
_SHOTS = (
    ("chase", 7.0, "flying north"),
    ("side", 12.6, "second side"),
    ("fixed", 17.6, "third side, climbing"),
    ("whole", 25.0, "path from above"),
)
_POSES_HZ = 50.0
_JPEG_QUALITY = 86


class Picture(NamedTuple):
    """A picture, or the reason for its absence."""

    caption: str
    data_uri: str
    """Empty without a picture; the caption is then the reason."""


def take(recordings: Mapping[str, Recording]) -> list[Picture]:
    """Render the flight along the desired trajectory; a failure becomes the caption of an empty picture."""
    if find_spec("mujoco") is None:
        return [Picture(f"No pictures: they need MuJoCo: {INSTALL_MULTIBODY}.", "")]
    plants = (cases.MULTIBODY, cases.RIGID, cases.SMALL_ANGLE)
    keys = (cases.key(cases.BACKSTEPPING, cases.DESIRED, cases.PLAIN, plant) for plant in plants)
    key = next((key for key in keys if key in recordings), None)
    if key is None:
        return [Picture("No pictures: no flight along the desired trajectory.", "")]
    try:
        return _drawn(recordings[key])
    except (OSError, subprocess.SubprocessError) as error:
        return [Picture(f"No pictures: {_reason(error)}.", "")]


def _reason(error: Exception) -> str:
    """Return the error of the renderer in one line."""
    output = str(getattr(error, "stderr", None) or "")
    lines = [line for line in output.splitlines() if line.strip()]
    if isinstance(error, subprocess.TimeoutExpired):
        return f"the renderer timed out after {RENDER_TIMEOUT_S:g} s"
    return (lines[-1] if lines else str(error)).rstrip(".")


def poses_of(recording: Recording) -> Poses:
    """Return a recording as poses, about 50 a second."""
    step = max(1, round(recording.case.inner_hz / _POSES_HZ))
    time_s = recording.time_s
    if len(time_s) > 1:  # a recording may have been thinned
        step = max(1, round(1.0 / _POSES_HZ / float(time_s[1] - time_s[0])))
    return Poses(
        time_s[::step],
        recording.position_ned_m[::step],
        quaternions_from_euler(recording.euler_rad[::step]),
        recording.rotor_speed_rad_s[::step],
        recording.reference[::step, :3],
        vehicle=recording.case.vehicle,
        title="desired trajectory",
    )


def _drawn(recording: Recording) -> list[Picture]:
    end_s = float(recording.time_s[-1])
    pictures = []
    with tempfile.TemporaryDirectory(prefix="gcs-paper-") as name:
        folder = Path(name)
        write_poses(folder / "poses.npz", poses_of(recording))
        for camera, at_s, words in _SHOTS:
            if at_s > end_s:
                continue
            file = folder / f"{camera}.png"
            _render(folder / "poses.npz", file, camera, at_s)
            caption = f"{at_s:g} s: {words}"
            pictures.append(Picture(caption, _data_uri(file)))
    return pictures


def _render(poses: Path, file: Path, camera: str, at_s: float) -> None:
    arguments = [f"--png={file}", f"--at={at_s:g}", f"--camera={camera}", f"--size={SIZE}", "--no-words"]
    subprocess.run(
        own_program("sim_bridge", "render", str(poses), *arguments),
        check=True,
        capture_output=True,
        text=True,
        timeout=RENDER_TIMEOUT_S,
        stdin=subprocess.DEVNULL,
    )


def _data_uri(file: Path) -> str:
    """Return the picture for the page: as JPEG, a fifth of the size, where Pillow is there."""
    if find_spec("PIL") is not None:
        from PIL import Image  # noqa: PLC0415  # an extra; modules of sim_bridge that come late import it at their top

        smaller = file.with_suffix(".jpg")
        with Image.open(file) as image:
            image.convert("RGB").save(smaller, quality=_JPEG_QUALITY)
        file = smaller
    kind = "jpeg" if file.suffix == ".jpg" else "png"
    return f"data:image/{kind};base64,{base64.b64encode(file.read_bytes()).decode('ascii')}"
