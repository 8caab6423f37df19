"""``gcs replay`` on real sockets, the real clock and a terminal."""

from __future__ import annotations

import select
import sys
import time
from pathlib import Path

from flightstack.mavlink.link import Link
from flightstack.process.ports import ports_config
from flightstack.transports.udp import PortBusyError
from flightstack.transports.vehicle_ports import Place, VehiclePorts
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.processes import Interruption
from gcs_cli.logs.reader import log_file, read_log, warn_if_damaged
from gcs_cli.logs.recording import ULOG
from gcs_cli.logs.tlog_reader import dated_records
from gcs_cli.output import Output
from gcs_cli.replay.keys import Keys
from gcs_cli.replay.logged_plans import LoggedPlans
from gcs_cli.replay.playback import Playback, TlogPlayback
from gcs_cli.replay.replay_vehicle import ReplayVehicle
from gcs_cli.replay.ulog_playback import UlogPlayback
from gcs_cli.run_directory import TLOG_NAME

_STEP_S = 0.02
_STATUS_S = 0.2
_JUMP_S = 10.0
_FACTOR = 2.0
_KEYS = "space pause, ← → 10 s, ↑ ↓ speed, home start, q end"


class ReplayPorts:
    """The ports of a vehicle for the replay; raise CliError (usage) if one is in use."""

    def __init__(self, instance: int, stations: list[str], listen: str) -> None:
        config = ports_config(instance, stations, None, None, listen, None)
        try:
            self._ports = VehiclePorts(config)
        except PortBusyError as error:
            raise CliError(f"{error}: end the vehicle that uses it, or give --instance N", USAGE) from None
        self.first_peers: list[Place] = self._ports.first_peers
        self.config = config

    def register(self, poller: select.poll) -> None:
        """Register all descriptors."""
        self._ports.register(poller)

    def exchange(self, vehicle: ReplayVehicle, now_s: float) -> None:
        """Receive the datagrams that have arrived, and send those that are due."""
        for channel, peer, data in self._ports.receive(vehicle.heard_s):
            vehicle.receive(data, (channel, peer), now_s)
        for place in self._ports.opened():
            vehicle.admit(place, now_s)
        for place in self._ports.closed():
            vehicle.forget(place)
        self.send(vehicle.poll(now_s))

    def send(self, frames: list[tuple[Place, bytes]]) -> None:
        """Send frames to their peers."""
        for (channel, peer), frame in frames:
            self._ports.send(channel, peer, frame)
        self._ports.flush()

    def close(self) -> None:
        """Close the sockets."""
        self._ports.close()


def playback_of(path: Path) -> Playback:
    """Return the messages of a log; raise CliError (usage)."""
    recording = read_log(path)
    warn_if_damaged(recording, recording.source)
    if recording.form == ULOG:
        return UlogPlayback(recording, _plans_beside(path, recording.vehicle[0]))
    return TlogPlayback(log_file(path).read_bytes(), recording.vehicle)


def _plans_beside(path: Path, vehicle: int) -> LoggedPlans | None:
    """Return the plans in the telemetry log of a flight's directory, if there is one."""
    tlog = path / TLOG_NAME
    if not tlog.is_file():
        return None
    plans, link = LoggedPlans(vehicle), Link(0, 0)
    for record in dated_records(tlog.read_bytes()):
        for message in link.decode(record.frame):
            plans.take(message, 1e-6 * record.time_us)
    return plans


def replay_log(
    path: Path, ports: ReplayPorts, out: Output, speed: float, begin_s: float, loops: bool, system: int | None
) -> None:
    """Replay a log until its end, a signal, or the key q; raise CliError."""
    playback = playback_of(path)
    if begin_s >= playback.duration_s:
        raise CliError(f"--from {begin_s:g}: the log lasts {playback.duration_s:.1f} s", USAGE)
    vehicle = ReplayVehicle(playback, ports.first_peers, time.monotonic(), speed, begin_s, system)
    stations = ", ".join(f"UDP {host}:{port}" for host, port in ports.config.ground_stations)
    said = f"replaying {path} ({playback.duration_s:.1f} s) as system {vehicle.address.system} to {stations}"
    facts = {"duration_s": playback.duration_s, "system_id": vehicle.address.system}
    out.say("replaying", said, file=str(path), **facts)
    poller = select.poll()
    ports.register(poller)
    with Interruption() as interruption, Keys() as keys:
        if keys.descriptor is not None:
            poller.register(keys.descriptor, select.POLLIN)
        screen = _StatusLine(vehicle, shows=sys.stdout.isatty() and not out.as_json)
        while not interruption.reason:
            ready = {descriptor for descriptor, _ in poller.poll(1e3 * _STEP_S)}
            ports.exchange(vehicle, time.monotonic())
            if keys.descriptor in ready and not apply_keys(vehicle, keys.read()):
                break
            if vehicle.has_ended:
                if not loops:
                    break
                vehicle.seek(0.0)
            screen.update()
        screen.clear()
        ports.send(vehicle.farewell())
    out.say("ended", f"replay ended at {vehicle.at_s:.1f} s", at_s=vehicle.at_s, refused=vehicle.refused)


def apply_keys(vehicle: ReplayVehicle, names: list[str]) -> bool:
    """Apply pressed keys; return False for the end."""
    for name in names:
        if name in ("q", "Q"):
            return False
        if name == " ":
            vehicle.is_paused = not vehicle.is_paused
        elif name in ("left", "right"):
            vehicle.seek(vehicle.at_s + (_JUMP_S if name == "right" else -_JUMP_S))
        elif name in ("up", "down"):
            vehicle.change_speed(_FACTOR if name == "up" else 1.0 / _FACTOR)
        elif name == "home":
            vehicle.seek(0.0)
    return True


class _StatusLine:
    """One line on the terminal with time, speed and keys."""

    def __init__(self, vehicle: ReplayVehicle, shows: bool) -> None:
        self._vehicle, self._shows = vehicle, shows
        self._due_s = 0.0

    def update(self) -> None:
        now_s = time.monotonic()
        if not self._shows or now_s < self._due_s:
            return
        self._due_s = now_s + _STATUS_S
        vehicle = self._vehicle
        word = "paused" if vehicle.is_paused else f"×{vehicle.speed:g}"
        text = f"{vehicle.at_s:7.1f} of {vehicle.duration_s:.1f} s  {word}  {_KEYS}"
        print(f"\r\x1b[K{text}", end="", flush=True)

    def clear(self) -> None:
        """Remove the line."""
        if self._shows:
            print("\r\x1b[K", end="", flush=True)
