"""The simulator as a process: one client over TCP, in lockstep or on the wall clock."""

from __future__ import annotations

import math
import select
import sys
import time
from typing import NamedTuple

from flightstack.geodesy import GeoPoint
from flightstack.params.vehicle import Vehicle
from sim_bridge.connection import (
    Connection,
    PeerClosedError,
    PeerSilentError,
    StoppedError,
    StopSignal,
    listen,
)
from sim_bridge.disturbance import wind_warning
from sim_bridge.lockstep import SimulatorLink
from sim_bridge.pacing import Pacer, ask_for_punctual_sleeps
from sim_bridge.plant import PlantOptions
from sim_bridge.simulator import PlantDivergedError, Simulator

DONE, FAILED, USAGE, NO_PEER = 0, 1, 2, 3
DEFAULT_TIMEOUT_S = 30.0


class ServerOptions(NamedTuple):
    """Everything a run of the simulator needs."""

    vehicle: Vehicle
    plant: str
    plant_options: PlantOptions
    home: GeoPoint
    speed: float  # math.inf: as fast as it goes
    host: str
    port: int
    system_id: int
    ideal_rotors: bool
    physics_hz: float
    timeout_s: float | None  # None: wait for a client for ever


def say(text: str) -> None:
    """Print a line for the user."""
    print(f"sim-bridge: {text}", flush=True)


def complain(text: str) -> None:
    """Print a warning or an error."""
    print(f"sim-bridge: {text}", file=sys.stderr, flush=True)


class Session:
    """One client's flight."""

    def __init__(self, link: SimulatorLink, connection: Connection, speed: float, stop: StopSignal) -> None:
        self.link = link
        self.exchanges = 0
        self.wall_s = 0.0
        self.pacer = None if math.isinf(speed) else Pacer(speed, stop.is_set)
        self._connection = connection
        self._stop = stop

    def run(self) -> None:
        """Exchange until the client ends, is lost, or the user stops; the exception says which."""
        link, connection = self.link, self._connection
        started = time.monotonic()
        try:
            while link.fault is None:
                if self._stop.stopped:
                    raise StoppedError
                if not link.ready:
                    self._take(connection.receive())
                elif link.free_running:
                    self._tick_on_wall_clock()
                else:
                    self._exchange_in_lockstep()
                    if self.exchanges == 1:
                        started = time.monotonic()
        finally:
            self.wall_s = time.monotonic() - started

    def _take(self, data: memoryview) -> None:
        self.link.receive(data)
        for reply in self.link.replies():
            self._connection.send(reply)

    def _exchange_in_lockstep(self) -> None:
        link = self.link
        self._connection.send(link.state())
        while not link.answered:
            self._take(self._connection.receive())
            if link.free_running or link.fault is not None:
                return
        link.step()
        self.exchanges += 1
        if self.pacer is not None:
            self.pacer.wait_until(link.simulator.time_us)

    def _tick_on_wall_clock(self) -> None:
        link, connection = self.link, self._connection
        if self.pacer is None:  # as fast as it goes means nothing to a client with a clock of its own
            self.pacer = Pacer(1.0, self._stop.is_set)
        self.pacer.wait_until(link.simulator.time_us)
        heard = False
        while (data := connection.receive_now()) is not None:
            heard = True
            self._take(data)
        connection.check_alive(heard)
        link.step()
        self.exchanges += 1
        connection.send(link.state())

    def report(self) -> None:
        """Print the figures of the session."""
        simulated_s = self.link.simulator.time_us * 1e-6
        factor = simulated_s / self.wall_s if self.wall_s > 0.0 else 0.0
        say(
            f"{simulated_s:.3f} s simulated in {self.wall_s:.3f} s ({factor:.1f} times real time), "
            f"{self.exchanges} exchanges, {self.link.stale} stale and {self.link.bad} bad messages, "
            f"{self.link.simulator.plant.bad_commands} bad commands"
        )
        if self.pacer is not None and self.pacer.lateness.count:
            late = self.pacer.lateness
            say(
                f"lateness mean {late.mean_us():.0f} µs, 99 % {late.percentile_us(99.0):.0f} µs, "
                f"max {late.max_us:.0f} µs; {self.pacer.slips} slips"
            )


def serve(options: ServerOptions) -> int:
    """Run the simulator for one client; return the exit code."""
    try:
        listener = listen(options.host, options.port)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        complain(
            f"cannot listen on {options.host}:{options.port}: {reason}; choose another --port or --instance"
        )
        return USAGE
    with listener:
        port = listener.getsockname()[1]
        speed = "max" if math.isinf(options.speed) else f"{options.speed:g}"
        say(
            f"{options.vehicle.name}, {options.plant} plant, {options.host}:{port}, speed {speed}, "
            f"seed {options.plant_options.seed}"
        )
        warning = wind_warning(options.vehicle, options.plant, options.plant_options.disturbance)
        if warning:
            complain(warning)
        simulator = _simulator(options)
        stop = StopSignal()
        timeout_s = options.timeout_s
        deadline_ns = None if timeout_s is None else time.monotonic_ns() + int(timeout_s * 1e9)
        try:
            stop.wait_for(listener, select.POLLIN, deadline_ns)
        except StoppedError:
            return DONE
        except PeerSilentError:
            complain(f"waited {timeout_s:g} s for a flight stack to connect to {options.host}:{port}")
            return NO_PEER
        sock, _ = listener.accept()
    ask_for_punctual_sleeps()
    timeout_s = DEFAULT_TIMEOUT_S if timeout_s is None else timeout_s
    link = SimulatorLink(simulator, options.vehicle, options.home, options.system_id)
    connection = Connection(sock, stop, timeout_s)
    code = _fly(Session(link, connection, options.speed, stop), connection, timeout_s)
    connection.close()
    return code


def _simulator(options: ServerOptions) -> Simulator:
    vehicle = options.vehicle.with_ideal_rotors() if options.ideal_rotors else options.vehicle
    return Simulator(
        vehicle,
        options.plant,
        options.plant_options,
        physics_hz=options.physics_hz,
        system_id=options.system_id,
    )


def _fly(session: Session, connection: Connection, timeout_s: float) -> int:
    link = session.link
    problem = ""
    try:
        session.run()
        problem = link.fault or ""
    except StoppedError:
        connection.send(link.goodbye())
    except PeerClosedError:
        if not link.said_goodbye:
            problem = (
                f"flight stack lost at t={link.simulator.time_us * 1e-6:.3f} s: it closed the connection"
            )
    except PeerSilentError:
        at = link.simulator.time_us * 1e-6
        problem = f"the flight stack did not answer for {timeout_s:g} s (lost at t={at:.3f} s)"
    except PlantDivergedError as error:
        problem = str(error)
        connection.send(link.goodbye())
    session.report()
    if problem:
        complain(problem)
        return FAILED
    return DONE
