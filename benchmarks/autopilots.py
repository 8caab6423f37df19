"""Other autopilots, from a checkout with its build: ``--against ardupilot=DIRECTORY,px4=DIRECTORY``.

A peer takes off and hovers as fast as it can on its own simulation, with its estimator, its log and its telemetry as
they come, read by a ``Connection`` in this process. Its factor is that of 60 s of hover, by the time in its messages.
It flies no mission: at a hundred times real time the upload exceeds what the vehicle's clock allows for an answer.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from benchmarks.peer_error import PeerError
from benchmarks.ports import is_free
from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions.in_flight import takeoff
from gcs_cli.errors import CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.link.perform import perform
from gcs_cli.output import Output
from gcs_cli.vehicle.view_types import VehicleView

_LATITUDE, _LONGITUDE, _ALTITUDE = "47.397742", "8.545594", "488"
"""Home of the plan."""
_UNLIMITED = "1000"
"""Speed factor that no machine reaches."""
_ALTITUDE_M, _HOVER_S = 5.0, 60.0
_LIMIT_S, _PAUSE_S = 60.0, 0.05


class Autopilot(NamedTuple):
    """Another autopilot: how its build is started, and where it answers."""

    title: str
    program: str
    """Path in the checkout."""
    arguments: Callable[[Path], tuple[str, ...]]
    """Arguments of the program, from the checkout."""
    environment: dict[str, str]
    endpoint: str
    port: int
    """The port of ``endpoint``, which has to be free before."""
    autopilot: int
    """Its MAV_AUTOPILOT."""

    def problem(self, checkout: Path) -> str:
        """Return the reason why the checkout cannot be flown, or an empty text."""
        if (checkout / self.program).is_file():
            return ""
        return f"{checkout} has no {self.program}: build it first"

    @contextlib.contextmanager
    def opened(self, checkout: Path) -> Iterator[dict[str, Callable[[], float]]]:
        """Yield what flies once, by the name of its row: each flight starts the program anew."""
        yield {self.title: partial(fly, self, checkout)}


AUTOPILOTS = {
    "ardupilot": Autopilot(
        "ArduCopter's SITL, one process",
        "build/sitl/bin/arducopter",
        lambda checkout: (
            *("--model", "quad", "--speedup", _UNLIMITED, "--wipe"),
            *("--defaults", str(checkout / "Tools" / "autotest" / "default_params" / "copter.parm")),
            *("--home", f"{_LATITUDE},{_LONGITUDE},{_ALTITUDE},0"),
        ),
        {},
        "tcp:127.0.0.1:5760",
        5760,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    ),
    "px4": Autopilot(
        "PX4's SIH, one process",
        "build/px4_sitl_default/bin/px4",
        lambda checkout: ("-d", "-w", ".", str(checkout / "build" / "px4_sitl_default" / "etc")),
        {
            "PX4_SIM_MODEL": "sihsim_quadx",
            "PX4_SIM_SPEED_FACTOR": _UNLIMITED,
            "PX4_HOME_LAT": _LATITUDE,
            "PX4_HOME_LON": _LONGITUDE,
            "PX4_HOME_ALT": _ALTITUDE,
        },
        "udpin:127.0.0.1:14550",
        14550,
        mavlink.MAV_AUTOPILOT_PX4,
    ),
}


class _Silent(Output):
    def say(self, event: str, sentence: str, **facts: object) -> None:
        """Print nothing."""


@contextlib.contextmanager
def _running(peer: Autopilot, checkout: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a peer in an empty directory, and end it."""
    for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
        if not is_free(kind, peer.port):
            raise PeerError(f"{peer.title}: port {peer.port} is in use")
    command = [str(checkout / peer.program), *peer.arguments(checkout)]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **peer.environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # with PX4's shells
            process.wait()


def _connected(peer: Autopilot, process: subprocess.Popen[bytes]) -> Connection:
    """Return a connection once the peer listens."""
    end_s = time.monotonic() + _LIMIT_S
    while True:
        try:
            return Connection(parse_endpoint(peer.endpoint))
        except CliError as error:
            if process.poll() is not None or time.monotonic() > end_s:
                raise PeerError(f"{peer.title}: {error}") from None
        time.sleep(_PAUSE_S)


def _is_in_air(view: VehicleView) -> bool:
    return view.armed and view.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR


def _take_off(connection: Connection) -> None:
    """Take off as soon as the vehicle can: its estimator needs half a minute of its time."""
    end_s = time.monotonic() + _LIMIT_S
    while True:
        try:
            perform(connection, takeoff(_ALTITUDE_M), _Silent(as_json=False))
            return
        except CliError:  # also if an answer was lost, as some of PX4's at this speed
            view = connection.session.view
            if _is_in_air(view):
                return
            if time.monotonic() > end_s:
                raise
        connection.step(connection.now_s + _PAUSE_S)


def fly(peer: Autopilot, checkout: Path) -> float:
    """Hover once; return the real-time factor."""
    with _running(peer, checkout) as process, _connected(peer, process) as connection:
        connection.wait_for_vehicle(_LIMIT_S)
        session = connection.session
        identity = session.view.identity
        if process.poll() is not None or identity is None or identity.autopilot != peer.autopilot:
            raise PeerError(f"{peer.title}: another vehicle answers at {peer.endpoint}")
        _take_off(connection)
        mode, began_s, from_s = session.view.mode, time.perf_counter(), _time_s(session.view)
        if not connection.wait_for(lambda: _time_s(session.view) > from_s + _HOVER_S, _LIMIT_S):
            raise PeerError(f"{peer.title} did not fly for {_HOVER_S:g} s within {_LIMIT_S:g} s")
        took_s = time.perf_counter() - began_s
        if not _is_in_air(session.view) or session.view.mode != mode:
            raise PeerError(f"{peer.title} did not hover: {session.view.mode} after {mode}")
        return (_time_s(session.view) - from_s) / took_s


def _time_s(view: VehicleView) -> float:
    if view.time_s is None:
        raise PeerError("the vehicle sends no time")
    return view.time_s
