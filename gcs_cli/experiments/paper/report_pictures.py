"""Pictures of the multibody vehicle in flight for the report, drawn by ``sim-bridge render`` where it can."""

from __future__ import annotations

import base64
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.flight_log.poses_file import Poses, write_poses
from flightstack.process.command_line import own_program
from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_labels import LABELS, PLANTS, anchored
from gcs_cli.experiments.paper.types import Recording
from gcs_cli.report.plots import section

SIZE = "960x540"
"""Twice as wide as the page shows them: figures in them would be too small to read, captions say what is seen."""
PATIENCE_S = 180.0
"""A renderer that takes longer is given up: software rendering of a picture takes a tenth of a second."""
_SHOTS = (
    ("chase", 7.0, "on its way north, nose down"),
    ("side", 12.6, "on the second side of the square, from the side"),
    ("fixed", 17.6, "third side, climbing and turning, from the ground"),
    ("whole", 25.0, "the way flown, from above, north up, lines on the ground every metre"),
)
_POSES_HZ = 50.0
_JPEG_QUALITY = 86


class Picture(NamedTuple):
    """A picture, or the sentence why there is none."""

    caption: str
    data_uri: str
    """Empty: there is no picture, and the caption says why."""


def take(recordings: Mapping[str, Recording]) -> list[Picture]:
    """Draw the flight along the desired trajectory; never raise: what cannot be drawn becomes a sentence."""
    if find_spec("mujoco") is None:
        return [Picture(f"No pictures: they need MuJoCo: {INSTALL_MULTIBODY}.", "")]
    plants = (cases.MULTIBODY, cases.RIGID, cases.SMALL_ANGLE)
    keys = (cases.key(cases.BACKSTEPPING, cases.DESIRED, cases.PLAIN, plant) for plant in plants)
    key = next((key for key in keys if key in recordings), None)
    if key is None:
        return [Picture("No pictures: nothing was flown along the desired trajectory.", "")]
    try:
        return _drawn(recordings[key])
    except (OSError, subprocess.SubprocessError) as error:
        return [Picture(f"No pictures: {_reason(error)}.", "")]


def _reason(error: Exception) -> str:
    """Say in one line what the renderer complained of."""
    told = getattr(error, "stderr", None) or ""
    lines = [line for line in str(told).splitlines() if line.strip()]
    if isinstance(error, subprocess.TimeoutExpired):
        return f"the renderer gave none within {PATIENCE_S:g} s"
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
        quaternions(recording.euler_rad[::step]),
        recording.rotor_speed_rad_s[::step],
        recording.reference[::step, :3],
        vehicle=recording.case.vehicle,
        title="desired trajectory",
    )


def quaternions(euler_rad: FloatArray) -> FloatArray:
    """Return body to world from roll, pitch and yaw, shape (n, 3), as quaternions of shape (n, 4), scalar first."""
    (cr, cp, cy), (sr, sp, sy) = (function(0.5 * euler_rad.T) for function in (np.cos, np.sin))
    return np.column_stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def _drawn(recording: Recording) -> list[Picture]:
    end_s = float(recording.time_s[-1])
    flown = f"{LABELS[cases.BACKSTEPPING]}, {PLANTS[recording.case.plant]}"
    pictures = []
    with tempfile.TemporaryDirectory(prefix="gcs-paper-") as name:
        folder = Path(name)
        write_poses(folder / "poses.npz", poses_of(recording))
        for camera, at_s, words in _SHOTS:
            if at_s > end_s:
                continue
            file = folder / f"{camera}.png"
            _render(folder / "poses.npz", file, camera, at_s)
            caption = f"{words[0].upper()}{words[1:]}; {at_s:g} s ({flown})"
            pictures.append(Picture(caption, _data_uri(file)))
    return pictures


def _render(poses: Path, file: Path, camera: str, at_s: float) -> None:
    arguments = [f"--png={file}", f"--at={at_s:g}", f"--camera={camera}", f"--size={SIZE}", "--no-words"]
    subprocess.run(
        own_program("sim_bridge", "render", str(poses), *arguments),
        check=True,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        stdin=subprocess.DEVNULL,
    )


def _data_uri(file: Path) -> str:
    """Return the picture for the page: as JPEG, a fifth of the size, where Pillow is there."""
    if find_spec("PIL") is not None:
        from PIL import Image  # noqa: PLC0415

        smaller = file.with_suffix(".jpg")
        with Image.open(file) as image:
            image.convert("RGB").save(smaller, quality=_JPEG_QUALITY)
        file = smaller
    kind = "jpeg" if file.suffix == ".jpg" else "png"
    return f"data:image/{kind};base64,{base64.b64encode(file.read_bytes()).decode('ascii')}"


def pictures_section(pictures: Sequence[Picture]) -> str:
    """Return the pictures; empty if none was asked for."""
    if not pictures:
        return ""
    drawn = "".join(
        f'<figure><img alt="{escape(one.caption)}" src="{escape(one.data_uri)}">'
        f"<figcaption>{escape(one.caption)}</figcaption></figure>"
        for one in pictures
        if one.data_uri
    )
    missing = "".join(f'<p class="none">{escape(one.caption)}</p>' for one in pictures if not one.data_uri)
    return anchored(
        "pictures", section("The vehicle in flight", f'<div class="pictures">{drawn}</div>{missing}')
    )
