"""``sim-bridge`` as a process on real TCP with pymavlink clients."""

from __future__ import annotations

import re
import signal
import socket
from collections.abc import Iterator

import pytest
from pymavlink import mavutil

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame
from tests.support.commands import sim_bridge_command
from tests.support.programs import Program

WAIT_S = 60.0  # of each wait; compilation on a loaded machine takes 10 s


class SimBridge:
    """The process, started on a free port."""

    def __init__(self, *arguments: str) -> None:
        self.process = Program("sim_bridge", ["--port", "0", *arguments])
        self.first_line = self.process.stdout.readline()
        found = re.search(r":(\d+), speed", self.first_line)
        assert found, self.first_line + self.end()[2]
        self.port = int(found.group(1))

    def end(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, out, err


class Client:
    """A flight stack that holds the rotors at one speed; a context that closes its connection."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)
        self.link = Link(1, 1)
        self.actuators = ActuatorsFrame()
        self.actuators.rotor_speed_rad_s[:4] = 220.0
        self.actuators.set_rotor_count(4)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, *messages) -> None:
        self.socket.sendall(b"".join(self.link.encode(message) for message in messages))

    def heartbeat(self, status: int = mavlink.MAV_STATE_ACTIVE) -> None:
        self.send(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, status, 3))

    def request(self, message_id: int = 53000, interval_us: int = 2000) -> None:
        self.heartbeat()
        self.send(mavlink.MAVLink_command_long_message(0, 0, 511, 0, message_id, interval_us, 0, 0, 0, 0, 0))

    def messages(self) -> Iterator[object]:
        while data := self.socket.recv(4096):
            yield from self.link.decode(data)

    def answer(self, time_us: int, flags: int = ARMED_FLAG | LOCKSTEP_FLAG) -> None:
        self.socket.sendall(self.actuators.seal(time_us, flags))

    def fly(self, count: int) -> list[int]:
        times = []
        for message in self.messages():
            if message.get_type() == "FS_PLANT_STATE":
                times.append(message.time_us)
                if len(times) == count:
                    break
                self.answer(message.time_us)
        return times


@pytest.fixture
def bridge() -> Iterator[SimBridge]:
    one = SimBridge("--speed", "max")
    yield one
    if one.process.poll() is None:
        one.process.kill()
        one.process.communicate()


def test_start_line_names_what_flies(bridge: SimBridge) -> None:
    assert (
        bridge.first_line
        == f"sim-bridge: paper_quad, rigid plant, 127.0.0.1:{bridge.port}, speed max, seed 1\n"
    )


def test_lockstep_flight_ends_in_order(bridge: SimBridge) -> None:
    client = Client(bridge.port)
    client.request()
    assert client.fly(501) == [2000 * step for step in range(501)]
    client.heartbeat(mavlink.MAV_STATE_POWEROFF)
    client.socket.close()
    code, out, err = bridge.end()
    assert (code, err) == (0, "")
    assert "1.000 s simulated" in out


def test_poweroff_heartbeat_is_read_with_an_unread_state_pending(bridge: SimBridge) -> None:
    client = Client(bridge.port)
    client.request()
    client.fly(10)
    client.answer(18_000)
    client.heartbeat(mavlink.MAV_STATE_POWEROFF)
    client.socket.close()  # with unread bytes: a connection reset
    assert bridge.end()[0] == 0


def test_lost_flight_stack_is_named_with_its_time(bridge: SimBridge) -> None:
    client = Client(bridge.port)
    client.request()
    client.fly(6)
    client.socket.close()
    code, _, err = bridge.end()
    assert code == 1
    assert err == "sim-bridge: flight stack lost at t=0.010 s: it closed the connection\n"


def test_silent_flight_stack_times_out() -> None:
    bridge = SimBridge("--timeout", "0.5")
    client = Client(bridge.port)
    client.request()
    client.fly(3)
    code, _, err = bridge.end()
    client.socket.close()
    assert code == 1
    assert err == "sim-bridge: the flight stack did not answer for 0.5 s (lost at t=0.004 s)\n"


def test_timeout_without_a_client() -> None:
    bridge = SimBridge("--timeout", "0.05")
    code, _, err = bridge.end()
    assert code == 3
    assert err == f"sim-bridge: waited 0.05 s for a flight stack to connect to 127.0.0.1:{bridge.port}\n"


def test_busy_port_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        done = sim_bridge_command("--port", port)
    assert done.returncode == 2
    assert done.stderr.startswith(f"sim-bridge: cannot listen on 127.0.0.1:{port}: Address already in use")
    assert done.stderr.count("\n") == 1


def test_port_of_a_simulator_in_flight_is_busy() -> None:
    """Its listener is closed then: a second simulator waited for a flight stack that flew with the first."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    bridge = SimBridge("--port", str(port))
    client = Client(bridge.port)
    client.request()
    client.fly(3)
    done = sim_bridge_command("--port", port, "--timeout", "0.05")
    assert done.stderr.startswith(f"sim-bridge: cannot listen on 127.0.0.1:{port}: Address already in use")
    assert done.returncode == 2
    client.socket.close()
    bridge.end()
    again = sim_bridge_command("--port", port, "--timeout", "0.05")
    assert again.returncode == 3


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("connected", [True, False])
def test_signals_end_in_order(bridge: SimBridge, number: signal.Signals, connected: bool) -> None:
    if not connected:
        bridge.process.send_signal(number)
        assert bridge.end()[0] == 0
        return
    with Client(bridge.port) as client:
        client.request()
        client.fly(5)
        bridge.process.send_signal(number)
        statuses = [m.system_status for m in client.messages() if m.get_type() == "HEARTBEAT"]
    assert statuses == [mavlink.MAV_STATE_POWEROFF]
    code, out, err = bridge.end()
    assert (code, out.splitlines()[-1], err) == (0, "sim-bridge: stopped", "")


def test_client_on_its_own_clock_gets_states_at_the_rate() -> None:
    bridge = SimBridge("--speed", "20")
    client = Client(bridge.port)
    client.request()
    times = []
    for message in client.messages():
        if message.get_type() == "FS_PLANT_STATE":
            times.append(message.time_us)
            if len(times) == 1:
                client.answer(0, flags=ARMED_FLAG)  # the only answer: the simulator waits for no other
            elif len(times) == 300:
                break
    assert times == [2000 * step for step in range(300)]
    client.heartbeat(mavlink.MAV_STATE_POWEROFF)
    client.socket.shutdown(socket.SHUT_WR)
    rest = list(client.messages())  # until the simulator closes
    client.socket.close()
    code, out, _ = bridge.end()
    assert {message.get_type() for message in rest} <= {"FS_PLANT_STATE", "BATTERY_STATUS"}
    assert code == 0
    assert "lateness mean" in out


def test_speed_max_without_effect_is_reported() -> None:
    bridge = SimBridge("--speed", "max")
    with Client(bridge.port) as client:
        client.request()
        states = (message for message in client.messages() if message.get_type() == "FS_PLANT_STATE")
        next(states)
        client.answer(0, flags=ARMED_FLAG)  # without the lockstep flag
        for _ in range(5):
            next(states)
        client.heartbeat(mavlink.MAV_STATE_POWEROFF)
    code, out, _ = bridge.end()
    assert code == 0
    assert "--speed max had no effect" in out


def test_same_commands_give_the_same_bytes_at_any_speed() -> None:
    received = []
    for speed in ("max", "10"):
        bridge = SimBridge(
            "--speed", speed, "--vehicle", "x_quad", "--wind", "3,1", "--gust", "1", "--torque-gust", "0.1",
            "--seed", "5",
        )  # fmt: skip
        client = Client(bridge.port)
        client.request()
        states = []
        for message in client.messages():
            if message.get_type() == "FS_PLANT_STATE":
                states.append(message.get_msgbuf())
                if len(states) == 200:
                    break
                client.answer(message.time_us)
        received.append([bytes(state) for state in states])
        client.heartbeat(mavlink.MAV_STATE_POWEROFF)
        client.socket.close()
        assert bridge.end()[0] == 0
    assert received[0] == received[1]


def test_third_party_flies_by_hil_messages(bridge: SimBridge) -> None:
    """Climb over pymavlink's own connection: request message 115, answer with HIL_ACTUATOR_CONTROLS."""
    peer = mavutil.mavlink_connection(f"tcp:127.0.0.1:{bridge.port}", source_system=1, source_component=1)
    peer.mav.heartbeat_send(2, 12, 0, 0, 4)
    peer.mav.command_long_send(0, 0, 511, 0, 115, 4000, 0, 0, 0, 0, 0)
    ack = peer.recv_match(type="COMMAND_ACK", blocking=True, timeout=WAIT_S)
    assert ack.result == 0
    altitudes_mm = []
    for step in range(251):
        state = peer.recv_match(type="HIL_STATE_QUATERNION", blocking=True, timeout=WAIT_S)
        assert state.time_usec == 4000 * (step + 1)  # zero is no time for PX4
        altitudes_mm.append(state.alt)
        peer.mav.hil_actuator_controls_send(state.time_usec, [0.6] * 4 + [0.0] * 12, 129, 1)
    peer.mav.heartbeat_send(2, 12, 0, 0, mavlink.MAV_STATE_POWEROFF)
    peer.close()
    code, out, _ = bridge.end()
    assert code == 0
    # thrust-to-weight 2 at full control: 0.6 climbs with 0.2 g, less a lag of 5 ms: ½·1.962·(1 s)² = 0.98 m;
    # the simulator does not wait for the first answers
    stale = re.search(r"(\d+) stale", out)
    assert stale is not None, out
    acted_s = 0.004 * (250 - int(stale[1]))
    assert altitudes_mm[0] == 488000
    assert 0.97 < (altitudes_mm[-1] - altitudes_mm[0]) / 1000.0 / (0.981 * acted_s**2) < 1.01


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--speed", "0"], "--speed: 0 is outside"),
        (["--speed", "fast"], "neither a number nor max"),
        (["--wind", "1"], "has 1 number, 2 or 3 are needed"),
        (["--plant", "flat"], "not one of rigid, paper"),
        (["--port", "70000"], "--port: 70000 is outside"),
        (["--timeout", "-3"], "--timeout: -3 is outside"),
        (["--physics-hz", "nan"], "--physics-hz: nan is outside"),
        (["--home", "91,0,0"], "--home latitude"),
        (["--vehicle", "none.toml"], "cannot be read"),
        (["fly"], "fly"),
        (["--battery-start", "101"], "--battery-start: 101 is outside"),
        (["--battery-capacity", "0"], "--battery-capacity: 0 is outside"),
        (["--battery-drain", "-1"], "--battery-drain: -1 is outside"),
        (["--fault", "rotor:9:off"], "--fault rotor:9:off: the vehicle has rotors 1 to 4"),
        (["--fault", "state:freeze@5-4"], "its end, 4 s, is not after its begin, 5 s"),
    ],
)
def test_usage_errors(arguments: list[str], said: str) -> None:
    done = sim_bridge_command(*arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_check_ends_without_a_client() -> None:
    done = sim_bridge_command("--check", "--fault", "rotor:1:off@3")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_battery_and_fault_options_act_in_a_process() -> None:
    bridge = SimBridge(
        "--speed", "max", "--battery-start", "40", "--fault", "rotor:2:off@0.1", "--fault", "battery:level=0.2@0.2"
    )  # fmt: skip
    charges, speeds = {}, {}
    with Client(bridge.port) as client:
        client.request()
        charge = None
        for message in client.messages():
            if message.get_type() == "BATTERY_STATUS":
                charge = message.battery_remaining
            elif message.get_type() == "FS_PLANT_STATE":
                charges[message.time_us], speeds[message.time_us] = charge, message.rotor_speed_rad_s
                if message.time_us == 300_000:
                    break
                client.answer(message.time_us)
        client.heartbeat(mavlink.MAV_STATE_POWEROFF)
    assert [charges[time_us] for time_us in (0, 198_000, 200_000)] == [40, 40, 20]
    assert speeds[100_000][1] == pytest.approx(220.0, rel=1e-6)
    assert speeds[300_000][1] < 1e-6
    assert speeds[300_000][0] == pytest.approx(220.0, rel=1e-6)
    assert bridge.end()[0] == 0


def test_dropping_states_in_lockstep_ends_with_a_sentence() -> None:
    bridge = SimBridge("--speed", "max", "--fault", "state:drop@5-6")
    with Client(bridge.port) as client:
        client.request()
        next(m for m in client.messages() if m.get_type() == "FS_PLANT_STATE")
        client.answer(0)
        code, _, err = bridge.end()
    assert code == 1
    assert err.startswith("sim-bridge: state:drop needs a flight stack on its own clock (--clock realtime)")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--wind", "5,0"], "--wind: wind cannot act: the vehicle paper_quad has no drag; add --drag"),
        (["--gust", "1", "--vehicle", "x_quad", "--plant", "paper"], "--gust: wind cannot act: the paper's model"),
        (["--drag", "--vehicle", "x_quad"], "--drag: the file of the vehicle x_quad has no optional_drag_n_s_m"),
        (["--drag", "--plant", "paper"], "--drag: the paper's model has no drag"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("command", [[], ["open-loop", "--rotors", "1,1,1,1", "--seconds", "1"]])
def test_wind_without_drag_is_a_usage_error(command: list[str], given: list[str], said: str) -> None:
    done = sim_bridge_command(*command, *given)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"sim-bridge: {said}")
    assert done.stderr.count("\n") == 1
