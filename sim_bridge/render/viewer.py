"""MuJoCo's viewer window: playback of a flight, or live view of a vehicle."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable
from typing import Any

from flightstack.core.contract import FloatArray
from flightstack.flight_log.poses_file import NO_POINTS
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.process.console import complain
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.marks import Marks
from sim_bridge.render.poses import FlightPath, Moment
from sim_bridge.render.renderer import Stage

_FRAME_S = 1.0 / 60.0
_SPACE, _RIGHT, _LEFT, _HOME = 32, 262, 263, 268  # key codes of GLFW
_SEEK_S = 2.0
_DISTANCE_SPANS, _ELEVATION_DEG, _AZIMUTH_DEG = 6.0, -20.0, -24.0

HELP = "space pauses, arrows seek, Home restarts; close the window to end"


class Playback:
    """Playback position: wall time in, flight time out. No I/O."""

    def __init__(self, begin_s: float, end_s: float, speed: float) -> None:
        self._begin_s, self._end_s, self._speed = begin_s, end_s, speed
        self._time_s = begin_s
        self._wall_s: float | None = None
        self.paused = False

    def at(self, wall_s: float) -> float:
        """Return the flight time to show; playback repeats from the start."""
        if self._wall_s is not None and not self.paused:
            self._time_s += (wall_s - self._wall_s) * self._speed
        self._wall_s = wall_s
        if self._time_s > self._end_s:
            self._time_s = self._begin_s
        return self._time_s

    def press(self, key: int) -> None:
        """Handle space, right, left and Home; ignore other keys."""
        if key == _SPACE:
            self.paused = not self.paused
        elif key in (_RIGHT, _LEFT):
            moved = self._time_s + (_SEEK_S if key == _RIGHT else -_SEEK_S)
            self._time_s = min(max(moved, self._begin_s), self._end_s)
        elif key == _HOME:
            self._time_s = self._begin_s


def require_display() -> None:
    """Raise UsageProblemError without a display, or without OpenGL on it."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise UsageProblemError(
            "--view: no display (neither DISPLAY nor WAYLAND_DISPLAY is set); run it in a desktop session, "
            "or make a film: gcs log draw RUN --video FILE"
        )
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the error below replaces its warning
        try:
            window = None
            if glfw.init():
                glfw.window_hint(glfw.VISIBLE, False)
                window = glfw.create_window(64, 64, "", None, None)
        finally:
            glfw.terminate()
    if not window:
        raise UsageProblemError("--view: the display has no OpenGL; check DISPLAY and its driver")


def play(vehicle: Vehicle, path: FlightPath, begin_s: float, end_s: float, speed: float, caller: str) -> None:
    """Play a flight until the window is closed; ``caller`` is the command for messages."""
    require_display()
    playback = Playback(begin_s, end_s, speed)
    complain(f"{caller.split(maxsplit=1)[0]}: {HELP}")

    def moments() -> Iterable[Moment]:
        while True:
            yield path.at(playback.at(time.monotonic()))

    stage = Stage(vehicle)
    marks = Marks(path.trail, path.poses.waypoints_ned_m, stage.span_m, stage.ground_m, path.waypoint_names())
    show(stage, moments(), marks, playback.press)


class LiveWindow:
    """The view of a vehicle that flies now. Raises UsageProblemError without a display, ConfigError."""

    def __init__(self, vehicle: str) -> None:
        """Draw a vehicle, a name or the path of its file."""
        require_display()
        self.vehicle = load_vehicle(vehicle)
        self._stage = Stage(self.vehicle)

    def show(self, moments: Iterable[Moment | None], trail: Callable[[float, int], FloatArray]) -> None:
        """Show moments and the trail behind them until the window is closed or they end."""
        show(self._stage, moments, Marks(trail, NO_POINTS, self._stage.span_m, self._stage.ground_m))


def show(
    stage: Stage, moments: Iterable[Moment | None], marks: Marks, press: Callable[[int], None] | None = None
) -> None:
    """Show moments in a window until it is closed or they end; None leaves the picture unchanged."""
    from mujoco.viewer import launch_passive

    others = set(threading.enumerate())
    with launch_passive(
        stage.model, stage.data, key_callback=press, show_left_ui=False, show_right_ui=False
    ) as window:
        with window.lock():
            _set_camera(window.cam, stage)
        for moment in moments:
            if not window.is_running():
                break
            if moment is not None:
                with window.lock():
                    stage.put(moment)
                    window.user_scn.ngeom = 0
                    stage.rotors.replace_discs(window.user_scn, stage.data)
                    marks.draw(window.user_scn, moment)
                window.sync()
            time.sleep(_FRAME_S)
    # Wait for the drawing thread, a daemon: the process would crash if Python terminated GLFW while it draws.
    # Without a timeout: on a loaded machine without a graphics card a picture takes many seconds.
    for thread in set(threading.enumerate()) - others:
        thread.join()


def _set_camera(camera: Any, stage: Stage) -> None:
    """Track the vehicle with the camera from behind."""
    import mujoco

    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = stage.body
    camera.distance = _DISTANCE_SPANS * stage.span_m
    camera.elevation, camera.azimuth = _ELEVATION_DEG, _AZIMUTH_DEG
