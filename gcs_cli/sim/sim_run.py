"""``gcs sim``: start the processes of all vehicles, wait until they are ready, and end them together."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from flightstack.core.atomic_file import check_creatable, check_new
from flightstack.core.port_numbers import vehicle_ground_port
from flightstack.mavlink.dialect import mavlink
from flightstack.process.config_check import DIRECTORY_HINT, check_state
from flightstack.process.console import complain
from flightstack.process.ports import ports_config
from flightstack.process.supervised import PreparedPrograms, supervised
from flightstack.transports.udp import UdpSocket
from gcs_cli.errors import FAILED, NO_ANSWER, CliError
from gcs_cli.fly.fly_options import check_options, check_ports, simulator_arguments
from gcs_cli.fly.processes import Children, Interruption
from gcs_cli.link import calls
from gcs_cli.link.endpoint import LOOPBACK
from gcs_cli.link.session import Session
from gcs_cli.output import Output
from gcs_cli.run_directory import SIMULATOR, STACK
from gcs_cli.sim.sim_flags import SimOptions
from gcs_cli.sim.sim_vehicles import (
    NONE,
    connections,
    local_host,
    name_of,
    ready_text,
    stack_arguments,
    start_of,
    station_port,
    vehicles_of,
)
from gcs_cli.vehicle_link import open_signing

_STEP_S, _START_STEP_S = 0.1, 0.005
"""Pause between two looks at the processes, when all vehicles are ready and before."""
_REQUEST_S = 0.02
"""Pause between two requests for the vehicle's state before it is ready."""
_END_TIMEOUT_S = 10.0


class VehicleProcesses:
    """Simulator and flight stack of one vehicle. ``is_ready`` after the first state of the simulator.

    The state is requested as a companion computer does, so that the vehicle counts no ground station.
    """

    def __init__(self, vehicle: SimOptions, children: Children) -> None:
        self.vehicle = vehicle
        self.children = children
        self.is_ready = False
        host = local_host(vehicle)
        self._socket = UdpSocket("127.0.0.1" if host.startswith("127.") else "0.0.0.0")
        self._session = Session(
            (host, vehicle_ground_port(vehicle.instance)),
            signing=open_signing(vehicle.signing_key),
            heartbeat_type=mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        )
        self._request_due_s = 0.0
        children.start(SIMULATOR, "sim_bridge", simulator_arguments(vehicle, start_of(vehicle)))
        children.start(STACK, "flightstack", stack_arguments(vehicle))

    def poll(self, now_s: float) -> bool:
        """Exchange messages until the vehicle is ready; return True when it has become ready."""
        if self.is_ready:
            return False
        for data, peer in self._socket.receive():
            self._session.receive(data, peer, now_s)
        self.is_ready = self._session.view.healthy is True
        known = self._session.view.identity is not None
        if known and not self.is_ready and now_s >= self._request_due_s:
            self._request_due_s = now_s + _REQUEST_S
            calls.command(self._session, *calls.REQUEST_SYS_STATUS, now_s)
        self._send(self._session.farewell() if self.is_ready else self._session.poll(now_s))
        if self.is_ready:
            self._socket.close()
        return self.is_ready

    def _send(self, frames: Sequence[bytes]) -> None:
        if self._session.peer is not None:
            for frame in frames:
                self._socket.send(frame, self._session.peer)

    @property
    def late_text(self) -> str:
        """The sentence about a vehicle that is not ready in time."""
        waited_s = self.vehicle.timeout_s
        return f"{name_of(self.vehicle)} was not ready within {waited_s:g} s: give more with --timeout"

    def show_notices(self) -> None:
        """Print the new warnings of the processes."""
        for line in self.children.notices():
            complain(line)

    def check(self) -> None:
        """Raise CliError if one of the processes has ended."""
        if not self.children.ended():
            return
        child = self.children.culprit(_END_TIMEOUT_S)
        assert child is not None
        said = f"{name_of(self.vehicle)}: {child.end_reason}"
        raise CliError(said, child.exit_code if child.exit_code in (1, 2, 3) else FAILED)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class Fleet:
    """The processes of all vehicles. The end of the ``with`` block stops them, each flight stack before its simulator.

    Their output goes to a temporary directory.
    """

    def __init__(self, prepared: PreparedPrograms | None) -> None:
        """``prepared`` become simulator and flight stack of the first vehicle."""
        self._prepared = prepared
        self._all: list[VehicleProcesses] = []
        self._ends = contextlib.ExitStack()
        self._folder = Path(self._ends.enter_context(tempfile.TemporaryDirectory(prefix="gcs-sim-")))

    @property
    def is_ready(self) -> bool:
        """True if all started vehicles are ready."""
        return all(processes.is_ready for processes in self._all)

    def start(self, vehicle: SimOptions) -> None:
        """Start the processes of a vehicle."""
        folder = self._folder / str(vehicle.instance)
        folder.mkdir()
        processes = VehicleProcesses(vehicle, self._ends.enter_context(Children(folder, self._prepared)))
        self._ends.callback(processes.close)
        self._all.append(processes)

    def step(self, out: Output, due_s: float, *, shows: bool = True) -> None:
        """Check the processes and report the vehicles that have become ready; raise CliError.

        Without ``shows``, warnings remain for a later call.
        """
        now_s = time.monotonic()
        for processes in self._all:
            if processes.poll(now_s):
                out.say("vehicle_ready", ready_text(processes.vehicle), **connections(processes.vehicle))
            elif not processes.is_ready and now_s >= due_s:
                raise CliError(processes.late_text, NO_ANSWER)
            if shows:
                processes.show_notices()
            processes.check()
        time.sleep(_STEP_S if self.is_ready else _START_STEP_S)

    def show_notices(self) -> None:
        """Print the new warnings of all processes."""
        for processes in self._all:
            processes.show_notices()

    def __enter__(self) -> Fleet:
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.close()


def check_vehicle(vehicle: SimOptions) -> None:
    """Check options, files and ports as simulator and flight stack do at their start; raise CliError, ConfigError."""
    check_state(vehicle.state, DIRECTORY_HINT)
    params = None if vehicle.params == Path(NONE) else vehicle.params
    if params is not None and not params.exists():  # the flight stack says so, and creates it
        check_creatable(params)
        params = None
    check_options(replace(vehicle, params=params), start_of(vehicle))
    if vehicle.log not in (None, NONE):
        log = Path(str(vehicle.log))
        check_new(log, vehicle.overwrite)
        check_creatable(log)
    if vehicle.state_dir not in (None, NONE):
        check_creatable(Path(str(vehicle.state_dir)), is_folder=True)
    ports_config(vehicle.instance, vehicle.gcs or [], None, None, vehicle.listen, None)
    check_ports(vehicle)


def simulate(options: SimOptions, out: Output, watch: bool, prepared: PreparedPrograms | None = None) -> None:
    """Run the vehicles until a signal, the end of the view, or the end of a process; raise CliError, ConfigError."""
    vehicles = vehicles_of(options)
    for vehicle in vehicles:
        check_vehicle(vehicle)
    first, *others = vehicles
    with Interruption() as interruption, Fleet(prepared) as fleet:
        due_s = time.monotonic() + options.timeout_s
        fleet.start(first)
        while not interruption.reason and not fleet.is_ready:
            fleet.step(out, due_s)
        for vehicle in others:  # which read the compiled kernels
            fleet.start(vehicle)
        while not interruption.reason and not fleet.is_ready:
            fleet.step(out, due_s)
        if not interruption.reason:
            out.say("ready", _ready_sentence(len(vehicles)), vehicles=len(vehicles))
            try:
                with opened_view(first, watch) as view:
                    while not interruption.reason and (view is None or view.poll() is None):
                        fleet.step(out, due_s, shows=view is None)
            finally:
                fleet.show_notices()
    out.say("ended", "simulation ended", reason=interruption.reason or "the view was closed")


def _ready_sentence(count: int) -> str:
    many = f"{count} vehicles are ready; " if count > 1 else ""
    return f"{many}Ctrl-C ends the simulation"


def view_link(vehicle: SimOptions) -> list[str]:
    """Return the options of the link on which the view finds the vehicle, or all of several."""
    port = station_port(vehicle)
    if vehicle.vehicles == 1 or port is None:
        return ["--instance", str(vehicle.instance)]
    return ["--connect", f"udpin:{LOOPBACK}:{port}"]


@contextlib.contextmanager
def opened_view(vehicle: SimOptions, wanted: bool) -> Iterator[subprocess.Popen[bytes] | None]:
    """Run ``gcs watch`` on this terminal; at the end terminate it, so that it restores the terminal.

    It ends with this process, also if that is killed.
    """
    if not wanted:
        yield None
        return
    signing = [] if vehicle.signing_key is None else ["--signing-key", str(vehicle.signing_key)]
    link = view_link(vehicle)
    inherited, own_end = os.pipe()
    program = supervised("gcs_cli", *signing, *link, "watch", descriptor=inherited)
    with subprocess.Popen(program, pass_fds=(inherited,)) as view:
        os.close(inherited)
        try:
            yield view
        finally:
            if view.poll() is None:
                view.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    view.wait(_END_TIMEOUT_S)
            view.kill()
            os.close(own_end)
