"""The files of one process over a reboot."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from flightstack.commander.transitions import Status
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.params.config import TRUTH, StackConfig
from flightstack.process.assembly import transfer_state
from flightstack.process.process_config import ProcessConfig
from flightstack.process.process_files import ProcessFiles
from flightstack.process.signing_file import load_key
from flightstack.services.routing.peer import PeerAddress
from flightstack.simulator_link.hot_frames import PlantStateFrame
from flightstack.transports.vehicle_ports import PortsConfig

PEER = PeerAddress(GROUND, "127.0.0.1", 5000)
START_LOGGING = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_LOGGING_START, 0, *[0] * 7)
REBOOT = mavlink.MAVLink_command_long_message(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0)


def process_files(
    folder: Path, signs: bool = True, log: Path | None = None, refusal: str | None = None
) -> ProcessFiles:
    ports = PortsConfig(0, (), ("127.0.0.1", 1), "127.0.0.1", 0)
    key = folder / "key" if signs else None
    return ProcessFiles(ProcessConfig("127.0.0.1", 1, 1.0, ports, log, False, None, key), lambda: refusal)


def test_a_recorded_signed_reboot_is_a_replay_after_the_reboot(tmp_path: Path) -> None:
    files, config = process_files(tmp_path), StackConfig()
    old = files.build(config)
    files.adopt(old, config)
    station = Link(255, 190, signing=LinkSigning(Signing(load_key(tmp_path / "key"), time.time), 0))
    recorded = station.encode(REBOOT)
    old.ground.receive(PEER, recorded, 0.0)
    assert old.ground.vehicle.reboot_requested
    new = files.build(config)
    files.adopt(new, config)
    transfer_state(old, new)
    new.ground.receive(PEER, recorded, 1.0)
    assert not new.ground.vehicle.reboot_requested
    new.ground.receive(PEER, station.encode(REBOOT), 1.0)
    assert new.ground.vehicle.reboot_requested


def test_vehicle_time_begins_anew_at_a_reboot(tmp_path: Path) -> None:
    files, config = process_files(tmp_path), StackConfig(state=TRUTH)
    old, new, frame = files.build(config), files.build(config), PlantStateFrame(1, 51)
    for time_us in (1_000_000, 1_002_000, 1_004_000):
        old.simulator.receive(memoryview(bytes(frame.seal(time_us, 0))))
    old.autopilot.tick(old.simulator.time_us)
    transfer_state(old, new)
    assert (new.simulator.time_us, new.now.time_us) == (0, 0)
    new.simulator.receive(memoryview(bytes(frame.seal(1_006_000, 0))))
    assert (new.simulator.time_us, new.simulator.time_jumps) == (2000, 0)
    assert new.simulator.freshness(2000) == (0, 0)


def test_a_parameter_changed_just_before_a_reboot_is_kept(tmp_path: Path) -> None:
    files, config = process_files(tmp_path), StackConfig(params_file=str(tmp_path / "vehicle.params"))
    old = files.build(config)
    files.adopt(old, config)
    old.params.set("MIS_TAKEOFF_ALT", 4.5)
    new = files.build(config)
    assert new.params.value("MIS_TAKEOFF_ALT") == 4.5
    old.params.set("MIS_TAKEOFF_ALT", 5.5)  # a reboot that comes to nothing leaves the saver at work
    files.close_parameters()
    assert "5.5" in (tmp_path / "vehicle.params").read_text()


def test_failed_build_keeps_current_stack(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.params"
    files, config = process_files(tmp_path), StackConfig(params_file=str(file))
    stack = files.build(config)
    files.adopt(stack, config)
    file.write_text("1\t1\tMIS_TAKEOFF_ALT\tnonsense\t9\n")
    with pytest.raises(ConfigError):
        files.build(config)
    file.write_text("")  # repaired: a damaged file is not overwritten
    stack.params.set("MIS_TAKEOFF_ALT", 5.5)
    files.close_parameters()
    assert "5.5" in file.read_text()


def test_a_reboot_that_cannot_be_prepared_is_refused_with_the_reason(tmp_path: Path) -> None:
    files, config = (
        process_files(tmp_path, signs=False, refusal="the parameter file cannot be read"),
        StackConfig(),
    )
    stack = files.build(config)
    station = Link(255, 190)
    stack.ground.receive(PEER, station.encode(REBOOT), 0.0)
    answers = [m for _, data in stack.ground.poll(0.0) for m in station.decode(data)]
    (ack,) = (m for m in answers if m.get_type() == "COMMAND_ACK")
    assert ack.result == mavlink.MAV_RESULT_FAILED
    texts = "".join(m.text for m in answers if m.get_type() == "STATUSTEXT")
    assert "the parameter file cannot be read" in texts
    assert not stack.ground.vehicle.reboot_requested


def test_the_log_in_progress_is_streamed_before_and_after_a_reboot(tmp_path: Path) -> None:
    files, config = (
        process_files(tmp_path, signs=False, log=tmp_path / "flight.ulg"),
        StackConfig(state=TRUTH),
    )
    for _ in range(2):
        stack, station = files.build(config), Link(255, 190)
        files.adopt(stack, config)
        assert stack.ground.vehicle.logs.open_tail() is None
        stack.recorder.status(0, Status(True, Mode.HOLD))
        stack.ground.receive(PEER, station.encode(START_LOGGING), 0.0)
        messages = [
            m for k in range(3) for _, data in stack.ground.poll(0.1 * k) for m in station.decode(data)
        ]
        pieces = [m for m in messages if m.get_type() == "LOGGING_DATA_ACKED"]
        assert bytes(pieces[0].data[:4]) == b"ULog"
        stack.recorder.close()
