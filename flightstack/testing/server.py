"""A vehicle as processes: simulator and flight stack with real sockets on free ports."""

from __future__ import annotations

import json
import math
import re
import select
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from flightstack.core.errors import ConfigError
from flightstack.core.port_numbers import api_client_port, ground_station_port
from flightstack.params.behaviour import SPECS, Behaviour
from flightstack.params.vehicle import load_vehicle
from flightstack.process.supervised import own_program
from flightstack.testing.instances import ServerError, ServerRefusalError, free_instance
from flightstack.testing.setup import OPTION_KEYS, Setup, with_keys
from gcs_cli.fly.fly_flags import LONGEST_S, TO_STACK, FlyOptions, passed
from gcs_cli.fly.fly_options import home_text, outer_rate_hz, simulator_arguments
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import LOOPBACK, parse_endpoint, vehicle_connection
from gcs_cli.run_directory import LOG_NAME, SIMULATOR, STACK

READY = b"ready\n"
"""Line of the guard when both processes have their ports."""
_GUARD_LOG = "guard.log"
_STEP_S = 0.1
_TAIL_LINES = 3
_REFUSED = re.compile(r"\S+ ended with code 2: (?:(--[\w-]+):? )?(.*)")
"""What the guard says if a process refuses its arguments."""
_KEYS = {**OPTION_KEYS, "--fault": "faults"}
_LOSS_TIMEOUTS = ("COM_DL_LOSS_T", "COM_OF_LOSS_T", "COM_RC_LOSS_T")


class _BusyError(ServerError):
    """Another program took a port of the instance."""


class Server:
    """Simulator and flight stack of one vehicle. They end with ``stop``, or with this process, however it ends."""

    def __init__(
        self,
        setup: Setup,
        folder: Path,
        *,
        speed: float = 1.0,
        timeout_s: float = 180.0,
        faults: Sequence[str] = (),
    ) -> None:
        """Start both at ``speed`` times real time, with their files in ``folder``, and wait until the vehicle can arm.

        ``faults`` are those of ``sim-bridge --fault``, such as ``"rotor 2 efficiency 0.7 @12"``: their times count from
        the start of the simulator. A client injects others with MAV_CMD_INJECT_FAILURE.

        The vehicle's timeouts for lost links are those of ``client_timeouts``, unless ``setup`` has them.

        Raise ServerRefusalError, which is a ServerError, for a condition or fault that the vehicle cannot have;
        ServerError if a process ends, or after ``timeout_s`` of wall time.
        Kernels that are not compiled yet take a minute.
        """
        self.setup = setup
        self.folder = folder
        """Directory of the flight logs and the output of the processes."""
        self.instance = 0
        """Number from which the ports derive."""
        self._faults = list(faults)
        self._kept_in: list[Path] = []
        self.guard: subprocess.Popen[bytes] | None = None
        end_s = time.monotonic() + timeout_s
        taken: set[int] = set()
        while self.guard is None:
            self.instance = free_instance(taken)
            taken.add(self.instance)
            try:
                self.guard = self._start(speed, timeout_s)
                self._await_ports(end_s)
                self._await_health(end_s)
            except _BusyError:  # another program took a port since: try the next instance
                self.guard = None
            except BaseException:
                self.stop()
                raise

    @property
    def mavsdk_url(self) -> str:
        """Connection of MAVSDK: ``udpin://127.0.0.1:PORT``."""
        return f"udpin://{LOOPBACK}:{api_client_port(self.instance)}"

    @property
    def mavlink_url(self) -> str:
        """Connection of pymavlink and MAVProxy: ``udpin:127.0.0.1:PORT``."""
        return f"udpin:{LOOPBACK}:{ground_station_port(self.instance)}"

    @property
    def gcs_url(self) -> str:
        """Argument of ``gcs --connect``: ``udpout:127.0.0.1:PORT``."""
        return vehicle_connection(self.instance)

    @property
    def log(self) -> Path:
        """The log of the first flight, complete after it."""
        return self.folder / LOG_NAME

    @property
    def output(self) -> str:
        """Output of both processes."""
        files = [self.folder / name for name in (f"{SIMULATOR}.log", f"{STACK}.log", _GUARD_LOG)]
        return "".join(path.read_text(errors="replace") for path in files if path.exists())

    def stop(self) -> None:
        """End both processes in order, and wait for their end; a second call does nothing."""
        if self.guard is None:
            return
        guard, self.guard = self.guard, None
        guard.communicate()  # closes its standard input
        for folder in self._kept_in:
            self._copy_to(folder)

    def keep_in(self, folder: Path) -> None:
        """Copy the files to ``folder`` once the processes have ended."""
        if self.guard is None:
            self._copy_to(folder)
        else:
            self._kept_in.append(folder)

    def _copy_to(self, folder: Path) -> None:
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)

    def lines(self) -> list[str]:
        """Return links and last output, for the report of a failed test."""
        return [f"server:  instance {self.instance}, {self.mavsdk_url}, {self.mavlink_url}", self._tail()]

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _start(self, speed: float, timeout_s: float) -> subprocess.Popen[bytes]:
        options = fly_options(self.setup, self.instance, speed)
        waits_s = max(options.timeout_s, min(timeout_s, LONGEST_S))
        options = replace(options, faults=self._faults, timeout_s=waits_s)
        home = self.setup.home
        simulator = simulator_arguments(options, home)
        stack = [
            *passed(options, TO_STACK), f"--home={home_text(home)}", f"--outer-hz={outer_rate_hz(options)!r}",
            f"--log={self.log}", "--params=none", "--state-dir=none", "--overwrite",
        ]  # fmt: skip
        command = own_program(
            "flightstack.testing.server_guard", str(self.folder), json.dumps(simulator), json.dumps(stack)
        )
        with (self.folder / _GUARD_LOG).open("wb") as errors:
            return subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, start_new_session=True
            )

    def _await_ports(self, end_s: float) -> None:
        """Wait until both processes have their ports."""
        assert self.guard is not None
        assert self.guard.stdout is not None
        while not select.select([self.guard.stdout], [], [], _STEP_S)[0]:
            self._check_time(end_s)
        line = self.guard.stdout.readline()
        if line != READY:
            self._raise_end(line)

    def _await_health(self, end_s: float) -> None:
        """Wait until the vehicle reports that it can arm."""
        assert self.guard is not None
        assert self.guard.stdout is not None
        with Connection(parse_endpoint(self.gcs_url)) as connection:
            session, request = connection.session, None
            while not session.view.healthy:
                now_s = connection.now_s
                if session.view.identity is not None and (
                    request is None or request.answer(now_s) is not None
                ):
                    # before the first state of the simulator, SYS_STATUS is sent on request only
                    request = calls.command(session, *calls.REQUEST_SYS_STATUS, now_s)
                connection.step(now_s + _STEP_S)
                if select.select([self.guard.stdout], [], [], 0.0)[0]:
                    self._raise_end(b"")
                self._check_time(end_s)

    def _check_time(self, end_s: float) -> None:
        if time.monotonic() > end_s:
            raise ServerError(f"the vehicle was not ready in time\n{self._tail()}")

    def _raise_end(self, line: bytes) -> NoReturn:
        """Raise the error of processes that have ended, for the reason that the guard gives."""
        assert self.guard is not None
        reason = (line + self.guard.communicate()[0]).decode(errors="replace").strip()
        if "in use" in reason:
            raise _BusyError(reason)
        if refusal := _refusal(reason):
            raise ServerRefusalError(refusal)
        raise ServerError(f"{reason or 'the processes ended'}\n{self._tail()}")

    def _tail(self) -> str:
        lines = self.output.splitlines()[-_TAIL_LINES:]
        return "\n".join(f"{'' if index else 'output:':8} {line}" for index, line in enumerate(lines))


def _refusal(reason: str) -> str:
    """Return the problem of an argument that a process refused, in words of the conditions; empty for another end."""
    refused = _REFUSED.fullmatch(reason)
    if refused is None:
        return ""
    option, problem = refused.groups()
    key = "" if option is None else _KEYS.get(option, option.removeprefix("--").replace("-", "_"))
    return f"{key}: {with_keys(problem)}" if key else problem


def fly_options(setup: Setup, instance: int, speed: float) -> FlyOptions:
    """Return ``setup`` as options of the processes."""

    def numbers(values: Sequence[float]) -> str | None:
        return ",".join(repr(float(value)) for value in values) if any(values) else None

    timeouts = client_timeouts(speed, _behaviour_of(setup.vehicle))
    return FlyOptions(
        vehicle=setup.vehicle,
        controller=setup.controller,
        gains=setup.gains,
        plant=setup.plant,
        loops=setup.loops,
        state=setup.state,
        speed="max" if math.isinf(speed) else repr(float(speed)),
        instance=instance,
        seed=setup.seed,
        wind=numbers(setup.wind),
        gust=setup.gust or None,
        drag=setup.drag,
        force=numbers(setup.force),
        torque=numbers(setup.torque),
        slope=setup.slope_deg or None,
        boat=numbers(setup.boat),
        torque_gust=setup.torque_gust or None,
        battery_start=setup.battery_percent,
        battery_capacity=setup.battery_capacity_mah,
        battery_drain=setup.battery_drain,
        ideal_rotors=setup.ideal_rotors,
        inner_hz=setup.inner_hz,
        outer_hz=setup.outer_hz,
        param=[f"{name}={value!r}" for name, value in (timeouts | dict(setup.params)).items()],
    )


def _behaviour_of(vehicle: str) -> Behaviour:
    """Return the vehicle's default parameters; the general ones for a bad file, which the simulator reports."""
    try:
        return load_vehicle(vehicle).behaviour
    except ConfigError:
        return Behaviour()


def client_timeouts(speed: float, behaviour: Behaviour | None = None) -> dict[str, float]:
    """Return the loss timeouts that give a client on the wall clock the same time at any speed.

    The vehicle counts simulated time: at 5 times real time, the timeout of setpoints, 1 s, is 0.2 s of wall time.
    ``behaviour`` has the timeouts in real time, by default those of the declarations.

    >>> client_timeouts(5.0)
    {'COM_DL_LOSS_T': 50, 'COM_OF_LOSS_T': 5.0, 'COM_RC_LOSS_T': 2.5}
    """
    found: dict[str, float] = {}
    defaults = (Behaviour() if behaviour is None else behaviour).by_name()
    for name in _LOSS_TIMEOUTS:
        spec = SPECS[name]
        value = min(defaults[name] * max(speed, 1.0), spec.high)
        found[name] = int(value) if spec.is_integer else value
    return found
