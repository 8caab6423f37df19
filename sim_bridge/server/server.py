"""The simulator process: one client over TCP, in lockstep or in real time."""

from __future__ import annotations

import contextlib
import errno
import math
import select
import socket
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.geodesy import GeoPoint
from flightstack.params.vehicle import Vehicle
from flightstack.process import collection
from flightstack.process.clock import minimise_timer_slack
from flightstack.process.compile_notice import announce_compilation
from sim_bridge.errors import PlantDivergedError
from sim_bridge.output import complain, say
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.faults.schedule import Fault
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.plants import kernels_of
from sim_bridge.render.live_view import LiveView
from sim_bridge.server.connection import (
    Connection,
    PeerClosedError,
    PeerSilentError,
    StoppedError,
    StopSignal,
    hold,
    listen,
)
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.server.session import Pace, Session
from sim_bridge.simulator import Simulator

if TYPE_CHECKING:
    from sim_bridge.server.quiet_exchanges import QuietExchanges

DONE, FAILED, USAGE, NO_PEER = 0, 1, 2, 3
DEFAULT_TIMEOUT_S = 30.0


class ServerOptions(NamedTuple):
    """Configuration of a run of the simulator."""

    vehicle: Vehicle
    plant: str
    plant_options: PlantOptions
    home: GeoPoint
    speed: float  # math.inf: unlimited
    head_start_s: float  # simulated time before that of the speed
    host: str
    port: int
    system_id: int
    ideal_rotors: bool
    physics_hz: float
    timeout_s: float | None  # None: wait for a client without a timeout
    faults: tuple[Fault, ...] = ()
    view: LiveView | None = None

    @property
    def hastens(self) -> bool:
        """True if simulated time passes at full speed, always or at the start."""
        return math.isinf(self.speed) or self.head_start_s > 0.0


def serve(options: ServerOptions) -> int:
    """Run the simulator for one client; return the exit code."""
    try:
        listener = listen(options.host, options.port)
        held = hold(listener) if options.port else contextlib.nullcontext()  # a free one is not given twice
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        port_is_bad = getattr(error, "errno", None) in (errno.EADDRINUSE, errno.EACCES)
        remedy = "choose another --port or --instance" if port_is_bad else "check --host"
        complain(f"cannot listen on {options.host}:{options.port}: {reason}; {remedy}")
        return USAGE
    with held:
        return _simulate(options, listener)


def _simulate(options: ServerOptions, listener: socket.socket) -> int:
    with listener:
        stop = StopSignal()
        _print_start(options, listener.getsockname()[1])
        announce_compilation("sim-bridge", kernels_of(options.plant))
        simulator = _make_simulator(options)  # may compile kernels; a client may connect meanwhile
        _compile_exchanges(options, simulator)
        try:
            client = _await_client(listener, stop, options.timeout_s)
        except StoppedError:
            complain("stopped")
            return DONE
        except PeerSilentError:
            host, port = listener.getsockname()[:2]
            complain(f"waited {options.timeout_s:g} s for a flight stack to connect to {host}:{port}")
            return NO_PEER
    collection.resume()
    minimise_timer_slack()
    timeout_s = DEFAULT_TIMEOUT_S if options.timeout_s is None else options.timeout_s
    link = FlightStackEndpoint(simulator, options.vehicle, options.home, options.system_id)
    view = contextlib.nullcontext() if options.view is None else options.view.watching(simulator)
    with client, view:
        connection = Connection(client, stop, timeout_s)
        quiet = _quiet_exchanges(link, client.fileno()) if options.hastens else None
        pace = Pace(options.speed, round(options.head_start_s * 1e6))
        return _run(Session(link, connection, pace, stop, quiet), connection, timeout_s)


def _print_start(options: ServerOptions, port: int) -> None:
    speed = "max" if math.isinf(options.speed) else f"{options.speed:g}"
    say(
        f"{options.vehicle.name}, {options.plant} plant, {options.host}:{port}, speed {speed}, "
        f"seed {options.plant_options.seed}"
    )


def _await_client(listener: socket.socket, stop: StopSignal, timeout_s: float | None) -> socket.socket:
    """Return the first client; raise StoppedError, or PeerSilentError at the timeout."""
    waiter = stop.waiter(listener, select.POLLIN)
    while True:
        waiter.wait(timeout_s)
        try:
            return listener.accept()[0]
        except OSError:  # the client disconnected before accept
            continue


def _make_simulator(options: ServerOptions) -> Simulator:
    vehicle = options.vehicle.with_ideal_rotors() if options.ideal_rotors else options.vehicle
    simulator = Simulator(
        vehicle,
        options.plant,
        options.plant_options,
        physics_hz=options.physics_hz,
        system_id=options.system_id,
    )
    if description := simulator.plant.description():
        say(description)
    simulator.inject(*options.faults)
    return simulator


def _compile_exchanges(options: ServerOptions, flown: Simulator) -> None:
    """Compile what exchanges at full speed need, or load it from the cache, with a simulator that is not flown."""
    if not (options.hastens and type(flown.plant) is CompiledPlant):
        return
    from sim_bridge.server.quiet_exchanges import compile_exchanges

    vehicle, physics_hz = options.vehicle, options.physics_hz
    simulator = Simulator(vehicle, options.plant, options.plant_options, physics_hz=physics_hz)
    compile_exchanges(simulator, vehicle, options.home)


def _quiet_exchanges(link: FlightStackEndpoint, descriptor: int) -> QuietExchanges:
    from sim_bridge.server.quiet_exchanges import QuietExchanges

    return QuietExchanges(link, descriptor)


def _run(session: Session, connection: Connection, timeout_s: float) -> int:
    link = session.link
    problem, is_stopped = "", False
    try:
        session.run()
        problem = link.error or ""
    except StoppedError:
        is_stopped = True
        connection.send_last(link.poweroff())
    except PeerClosedError:
        if not link.peer_ended:
            problem = (
                f"flight stack lost at t={link.simulator.time_us * 1e-6:.3f} s: it closed the connection"
            )
    except PeerSilentError:
        at = link.simulator.time_us * 1e-6
        problem = f"the flight stack did not answer for {timeout_s:g} s (lost at t={at:.3f} s)"
    except PlantDivergedError as error:
        problem = str(error)
        connection.send_last(link.poweroff())
    for line in session.report():
        say(line)
    if problem:
        complain(problem)
        return FAILED
    if is_stopped:
        say("stopped")
    return DONE
