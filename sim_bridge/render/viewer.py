"""MuJoCo's window: a flight played back, or a vehicle as it flies."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable
from typing import Any

from flightstack.params.vehicle import Vehicle
from flightstack.process.console import complain
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.marks import Marks
from sim_bridge.render.poses import FlightPath, Moment
from sim_bridge.render.renderer import Stage

_FRAME_S = 1.0 / 60.0
_SPACE, _RIGHT, _LEFT, _HOME = 32, 262, 263, 268  # GLFW's numbers of keys
_SEEK_S = 2.0
_DISTANCE_SPANS, _ELEVATION_DEG, _AZIMUTH_DEG = 6.0, -20.0, -24.0

HELP = "space stops and goes on, the arrows go back and forth, Home begins anew; close the window to end"


class Playback:
    """Which moment of a flight is shown: wall time in, time of the flight out. No I/O."""

    def __init__(self, begin_s: float, end_s: float, speed: float) -> None:
        self._begin_s, self._end_s, self._speed = begin_s, end_s, speed
        self._time_s = begin_s
        self._wall_s: float | None = None
        self.paused = False

    def at(self, wall_s: float) -> float:
        """Return the time to show; at the end the flight begins anew."""
        if self._wall_s is not None and not self.paused:
            self._time_s += (wall_s - self._wall_s) * self._speed
        self._wall_s = wall_s
        if self._time_s > self._end_s:
            self._time_s = self._begin_s
        return self._time_s

    def press(self, key: int) -> None:
        """Take a key; others than the four mean nothing."""
        if key == _SPACE:
            self.paused = not self.paused
        elif key in (_RIGHT, _LEFT):
            moved = self._time_s + (_SEEK_S if key == _RIGHT else -_SEEK_S)
            self._time_s = min(max(moved, self._begin_s), self._end_s)
        elif key == _HOME:
            self._time_s = self._begin_s


def require_display() -> None:
    """Raise UsageProblemError when there is no screen to open a window on, or no OpenGL for it."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise UsageProblemError(
            "--view: no display (neither DISPLAY nor WAYLAND_DISPLAY is set): run it in a desktop session, "
            "or make a film: gcs replay RUN --video FILE"
        )
    import glfw  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of what the sentence below says
        try:
            window = None
            if glfw.init():
                glfw.window_hint(glfw.VISIBLE, False)
                window = glfw.create_window(64, 64, "", None, None)
        finally:
            glfw.terminate()
    if not window:
        raise UsageProblemError(
            "--view: the display gives no window with OpenGL: check DISPLAY and its driver"
        )


def play(vehicle: Vehicle, path: FlightPath, begin_s: float, end_s: float, speed: float, caller: str) -> None:
    """Play a flight until the window is closed; ``caller`` is the command that was given."""
    require_display()
    playback = Playback(begin_s, end_s, speed)
    complain(f"{caller.split(maxsplit=1)[0]}: {HELP}")

    def moments() -> Iterable[Moment]:
        while True:
            yield path.at(playback.at(time.monotonic()))

    stage = Stage(vehicle)
    marks = Marks(path.trail, path.poses.waypoints_ned_m, stage.span_m, stage.ground_m, path.place_names())
    show(stage, moments(), marks, playback.press)


def show(
    stage: Stage, moments: Iterable[Moment | None], marks: Marks, press: Callable[[int], None] | None = None
) -> None:
    """Show moments in a window until it is closed or there are no more; None leaves what is shown."""
    from mujoco.viewer import launch_passive  # noqa: PLC0415  # needs a display

    others = set(threading.enumerate())
    with launch_passive(
        stage.model, stage.data, key_callback=press, show_left_ui=False, show_right_ui=False
    ) as window:
        with window.lock():
            _aim(window.cam, stage)
        for moment in moments:
            if not window.is_running():
                break
            if moment is not None:
                with window.lock():
                    stage.put(moment)
                    window.user_scn.ngeom = 0
                    stage.rotors.lift_discs(window.user_scn, stage.data)
                    marks.draw(window.user_scn, moment)
                window.sync()
            time.sleep(_FRAME_S)
    # The drawing thread is a daemon. If Python ends while it still draws, GLFW is terminated under it and the process
    # crashes. On a loaded machine without a graphics card its last picture takes many seconds: no limit here.
    for thread in set(threading.enumerate()) - others:
        thread.join()


def _aim(camera: Any, stage: Stage) -> None:
    """Follow the vehicle from behind; the mouse turns and zooms."""
    import mujoco  # noqa: PLC0415

    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = stage.body
    camera.distance = _DISTANCE_SPANS * stage.span_m
    camera.elevation, camera.azimuth = _ELEVATION_DEG, _AZIMUTH_DEG
