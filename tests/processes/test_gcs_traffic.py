"""``gcs messages``, ``listen``, ``send``, ``record`` and ``shell`` against a scripted vehicle and a real one."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gcs_cli.__main__ import main
from gcs_cli.link.tlog import TlogFile, decode_records, encode_record
from tests.support.commands import Ended, gcs
from tests.support.fake_links import udp_vehicles
from tests.support.fake_vehicle import ARM, SET_INTERVAL, FakeVehicle
from tests.support.vehicle_processes import vehicle as real_vehicle

LONG_S = 60.0
"""Hang guard [s]."""


@pytest.fixture(autouse=True)
def _own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run").mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def vehicle() -> FakeVehicle:
    return FakeVehicle()


@pytest.fixture
def link(vehicle: FakeVehicle) -> Iterator[str]:
    with udp_vehicles(vehicle) as port:
        yield f"--connect=udpout:127.0.0.1:{port}"


def lines(result: Ended) -> list[dict[str, object]]:
    assert (result.stderr, result.returncode) == ("", 0)
    return [json.loads(line) for line in result.stdout.splitlines()]


# ------------------------------------------------------------------ messages


def test_messages_prints_texts_up_to_a_severity(tmp_path: Path) -> None:
    vehicle, path = FakeVehicle(), tmp_path / "flight.tlog"
    frames = vehicle.poll(0.0)
    vehicle.say("detail", severity=7)
    vehicle.say("Battery is low", severity=4)
    frames += vehicle.poll(0.1)
    path.write_bytes(b"".join(encode_record(number * 1000, frame) for number, frame in enumerate(frames)))
    (line,) = lines(gcs("--connect", path, "messages", "--level", "warning", "--json"))
    assert (line["event"], line["severity"], line["text"], line["system"]) == (
        "message", "warning", "Battery is low", 1,
    )  # fmt: skip


def test_messages_begins_with_those_of_before(tmp_path: Path) -> None:
    with real_vehicle(tmp_path, with_simulator=False) as stack:
        assert gcs("--connect", stack.link, "arm").returncode == 1
        past = lines(gcs("--connect", stack.link, "messages", "--duration", "0", "--json"))
        assert past[-1]["text"] == "Command refused: no valid position and attitude yet"
        assert (past[-1]["severity"], past[-1]["past"]) == ("warning", True)
        assert gcs("--connect", stack.link, "messages", "--duration", "0", "--past", "0").stdout == ""


def test_messages_ends_after_its_duration(link: str) -> None:
    assert gcs(link, "messages", "--duration", "0.1") == ("", "", 0)


def test_messages_refuses_an_unknown_severity(link: str) -> None:
    result = gcs(link, "messages", "--level", "loud")
    assert (result.stdout, result.returncode) == ("", 2)
    assert "messages: --level loud: choose one of emergency, " in result.stderr


# ------------------------------------------------------------------ listen


def test_listen_prints_fields_alone(link: str) -> None:
    result = gcs(link, "listen", "attitude", "--field", "roll", "--field", "pitch", "--count", "2")
    assert result == ("0.1\t-0.05\n" * 2, "", 0)


def test_listen_requests_a_rate_and_sets_it_back(vehicle: FakeVehicle, link: str) -> None:
    (line,) = lines(gcs(link, "listen", "ESC_STATUS", "--rate", "5", "--count", "1", "--json"))
    assert line["fields"]["rpm"] == [2310, 2290, 2305, 2400]  # type: ignore[index]
    gcs(link, "status")  # the request without an answer has arrived by then
    intervals = [params[:2] for command, params in vehicle.commands if command == SET_INTERVAL]
    assert intervals[:2] == [(291, 200_000), (291, 0)]


def test_listen_names_a_refused_rate(link: str) -> None:
    result = gcs(link, "listen", "ODOMETRY", "--rate", "5")
    assert result.returncode == 1
    assert result.stderr == (
        "gcs: listen: ODOMETRY at 5 Hz refused: the vehicle answered MAV_RESULT_UNSUPPORTED\n"
    )


def test_listen_ends_without_the_message(link: str) -> None:
    result = gcs(link, "listen", "ODOMETRY", "--timeout", "1.5")
    assert result == ("", "gcs: listen: no ODOMETRY within 1.5 s: request it with --rate\n", 3)


def test_listen_lists_every_message_with_its_rate(link: str) -> None:
    streams = {
        str(line["message"]): line for line in lines(gcs(link, "listen", "--duration", "2.2", "--json"))
    }
    assert {"HEARTBEAT", "ATTITUDE"} <= streams.keys()
    assert streams["ATTITUDE"]["message_id"] == 30
    assert float(str(streams["HEARTBEAT"]["rate_hz"])) > 0.4


@pytest.mark.parametrize("words", [["ATITUDE"], ["ATTITUDE", "--field", "rol"], ["--rate", "3"]])
def test_listen_refuses_wrong_words_before_it_searches(words: list[str]) -> None:
    result = gcs("--connect", "udpout:127.0.0.1:1", "listen", *words)
    assert (result.stdout, result.returncode) == ("", 2)
    assert result.stderr.startswith("gcs: listen: ")


# ------------------------------------------------------------------ send


def test_sent_command_is_answered(vehicle: FakeVehicle, link: str) -> None:
    result = gcs(link, "send", "COMMAND_LONG", "command=COMPONENT_ARM_DISARM", "param1=1")
    name = "MAV_CMD_COMPONENT_ARM_DISARM"
    assert result == (f"sent COMMAND_LONG  command {name}  param1 1, {name} accepted\n", "", 0)
    assert vehicle.commands == [(ARM, (1.0, 0, 0, 0, 0, 0, 0))]


def test_refused_command_is_named(vehicle: FakeVehicle, link: str) -> None:
    vehicle.refusals[ARM] = "Command refused: too hot"
    result = gcs(link, "send", "COMMAND_LONG", "command=400", "param1=1")
    assert result == ("", "gcs: send: MAV_CMD_COMPONENT_ARM_DISARM refused: too hot\n", 1)


def test_message_is_sent_several_times(vehicle: FakeVehicle, link: str) -> None:
    result = gcs(link, "send", "MANUAL_CONTROL", "z=500", "--count", "3", "--rate", "50")
    assert result.stdout == "sent MANUAL_CONTROL  z 500, 3 times\n"
    gcs(link, "status")
    assert vehicle.heard.count("MANUAL_CONTROL") == 3


# ------------------------------------------------------------------ record


def test_record_holds_both_directions(tmp_path: Path, link: str) -> None:
    path = tmp_path / "flight.tlog"
    (line,) = lines(gcs(link, "record", path, "--duration", "1.2", "--json"))
    records = list(decode_records(path.read_bytes()))
    assert len(records) == line["messages"]
    assert {record.frame[5] for record in records} == {1, 255}
    assert sorted(record.time_us for record in records) == [record.time_us for record in records]
    assert gcs("--connect", path, "listen", "HEARTBEAT", "--count", "1").returncode == 0
    assert [entry.name for entry in tmp_path.iterdir() if "tlog" in entry.name] == ["flight.tlog"]


def test_record_keeps_existing_files(tmp_path: Path, link: str) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"mine")
    assert gcs(link, "record", path).returncode == 2
    assert path.read_bytes() == b"mine"
    assert (
        gcs("--timeout", "0.2", "--connect", "udpout:127.0.0.1:1", "record", path, "--overwrite").returncode
        == 3
    )
    assert path.read_bytes() == b"mine"
    assert gcs(link, "record", path, "--overwrite", "--duration", "0.1").returncode == 0
    assert path.read_bytes() != b"mine"


def test_interrupted_record_ends_in_order(tmp_path: Path, link: str) -> None:
    path = tmp_path / "flight.tlog"
    command = [sys.executable, "-m", "gcs_cli", link, "record", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not (path.exists() and path.stat().st_size):
            assert process.poll() is None
            select.select([], [], [], 0.02)
        process.send_signal(signal.SIGINT)
        said, complaint = process.communicate(timeout=LONG_S)
    assert (process.returncode, complaint) == (0, "")
    assert said.endswith(f"recorded in {path}\n")


def test_record_interrupted_at_its_first_frame_ends_in_order(
    tmp_path: Path, link: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(TlogFile, "write", interrupted)
    path = tmp_path / "flight.tlog"
    assert main([*link.split(), "record", str(path)]) == 0
    assert capsys.readouterr().out.endswith(f"recorded in {path}\n")


# ------------------------------------------------------------------ shell


def test_script_runs_over_one_link_until_a_command_fails(
    tmp_path: Path, vehicle: FakeVehicle, link: str
) -> None:
    script = tmp_path / "check.gcs"
    script.write_text("# arming\narm\n\ngcs disarm  # again\nfrobnicate\narm\n")
    result = gcs(link, "shell", script)
    assert (result.stdout, result.returncode) == ("armed\ndisarmed\n", 2)
    assert "No such command 'frobnicate'" in result.stderr
    assert [command for command, _ in vehicle.commands] == [ARM, ARM]


def test_shell_commands_choose_their_own_vehicle() -> None:
    one, two = FakeVehicle(1), FakeVehicle(2)
    with udp_vehicles(one, two) as port:
        link = f"udpout:127.0.0.1:{port}"
        result = gcs("--connect", link, "--system", "1", "shell", "-c", "arm --system 2", "-c", "disarm")
    assert result == ("armed\ndisarmed\n", "", 0)
    assert (one.commands[-1][1][0], two.commands[-1][1][0]) == (0.0, 1.0)


def test_shell_errors_are_json_lines(link: str) -> None:
    result = gcs(link, "--json", "shell", "-c", "send HEARTBEAT", "-c", "frobnicate")
    first, second = (json.loads(line) for line in result.stdout.splitlines())
    assert (first["event"], second["event"], result.returncode) == ("sent", "error", 2)


def test_typed_commands_are_completed_and_kept(tmp_path: Path, link: str) -> None:
    """The prompt shows the vehicle; an error or Ctrl-C does not end the shell, Ctrl-D does."""
    main, other = pty.openpty()
    command = [sys.executable, "-m", "gcs_cli", link, "--timeout=60", "shell"]
    environment = {**os.environ, "TERM": "dumb", "INPUTRC": "/dev/null"}
    process = subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=environment)
    os.close(other)

    seen = ""

    def read_until(text: str) -> None:
        nonlocal seen
        while text not in seen:
            assert select.select([main], [], [], LONG_S)[0], seen
            seen += os.read(main, 4096).decode()
        seen = seen.partition(text)[2]

    try:
        read_until("1 HOLD disarmed> ")
        os.write(main, b"ar\t\n")
        read_until("armed")
        read_until("1 HOLD armed> ")
        # Python notices a signal that comes before it waits for a key only after the next line
        process.send_signal(signal.SIGINT)
        os.write(main, b"\n")
        read_until("> ")
        os.write(main, b"frobnicate\n")
        read_until("No such command")
        read_until("> ")  # the only prompt since, so that the terminal passes on the key
        os.write(main, b"\x04")
        assert process.wait(LONG_S) == 0
    finally:
        process.kill()
        process.wait()
        os.close(main)
    assert (tmp_path / "state" / "gcs" / "history").read_text().split() == ["arm", "frobnicate"]


# ------------------------------------------------------------------ a real vehicle


def test_traffic_commands_with_a_real_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    with real_vehicle(tmp_path) as processes:
        processes.wait_until_healthy()
        link = ["--connect", processes.link]
        (line,) = lines(gcs(*link, "listen", "ATTITUDE_QUATERNION", "--rate", "20", "--count", "1", "--json"))
        assert line["system"] == processes.instance + 1
        assert gcs(*link, "send", "COMMAND_LONG", "command=REQUEST_MESSAGE", "param1=148").returncode == 0
        assert lines(gcs(*link, "record", path, "--duration", "1", "--json"))[0]["messages"]
        texts = gcs(*link, "--json", "shell", "-c", "send COMMAND_LONG command=DO_SET_MODE param1=77")
        assert texts.returncode == 1
        assert gcs(*link, "messages", "--duration", "0.2").returncode == 0
    names = {
        json.loads(row)["message"] for row in gcs("--connect", path, "listen", "--json").stdout.splitlines()
    }
    assert {"HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT"} <= names
