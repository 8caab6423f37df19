"""pymavlink's MAVLink FTP client and the log protocol: what scripts fetch after a flight."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.mavftp import MAVFTP, FtpError

from flightstack.services.files.component_metadata import GENERAL, LOGS_FLAT, PARAMETERS
from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import Witness
from tests.support.process import BOUND_S

LOG_DATA_SIZE = 90
SPEED = 1.0
"""None of the tests flies."""


@pytest.fixture
def script(station_vehicle: RealVehicle) -> Iterator[Witness]:
    script = Witness(f"tcp:{HOST}:{station_vehicle.tcp_port}", 1 + station_vehicle.instance)
    yield script
    script.close()


class WaitingLink:
    """The connection, on which pymavlink's client waits: it polls, which takes a core for seconds."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    def recv_match(self, **options: Any) -> Any:
        """Return the next message that fits, or None after ``timeout``."""
        return self._connection.recv_match(**{"blocking": "timeout" in options, **options})


class PatientFtp(MAVFTP):  # type: ignore[misc]
    """pymavlink's client with more time than the 5 s that it gives a list of files."""

    def process_ftp_reply(self, operation_name: str, timeout: float = BOUND_S) -> Any:
        return super().process_ftp_reply(operation_name, BOUND_S)


@pytest.fixture
def files(script: Witness) -> MAVFTP:
    """It counts as idle when it has sent nothing for a while, also in a burst: its own 3.7 s may be too short."""
    files = PatientFtp(WaitingLink(script.connection), script.system, 1)
    files.ftp_settings.idle_detection_time = BOUND_S / 2
    return files


def fetch(files: MAVFTP, path: str, target: Path) -> bytes:
    """Fetch a file in bursts."""
    files.cmd_get([path, str(target)])
    assert files.process_ftp_reply("get", timeout=BOUND_S).error_code == FtpError.Success
    return target.read_bytes()


def names(files: MAVFTP, path: str) -> list[str]:
    assert files.cmd_list([path]).error_code == FtpError.Success
    return sorted(entry.name for entry in files.list_result)


def test_files_are_listed_and_fetched(files: MAVFTP, tmp_path: Path) -> None:
    assert names(files, "/") == ["@MAV_LOG", "@PARAM", "@SYS", "etc", "fs"]
    assert {Path(GENERAL).name, Path(PARAMETERS).name} < set(names(files, str(Path(GENERAL).parent)))
    assert json.loads(fetch(files, GENERAL, tmp_path / "general.json"))["version"] == 1
    parameters = fetch(files, PARAMETERS, tmp_path / "parameters.json")  # much more than one burst
    assert any(entry["name"] == "MIS_TAKEOFF_ALT" for entry in json.loads(parameters)["parameters"])
    assert files.read(PARAMETERS, 300, 1000) == parameters[1000:1300]


def test_parameters_come_in_one_file_with_their_defaults(files: MAVFTP, tmp_path: Path) -> None:
    values, defaults = tmp_path / "values.param", tmp_path / "defaults.param"
    files.cmd_getparams([str(values), str(defaults)])
    assert files.process_ftp_reply("getparams", timeout=BOUND_S).error_code == FtpError.Success
    assert "MIS_TAKEOFF_ALT,2.5" in defaults.read_text().splitlines()
    assert len(values.read_text().splitlines()) == len(defaults.read_text().splitlines())


def test_nothing_is_written_and_nothing_found_that_is_not_there(script: Witness, tmp_path: Path) -> None:
    files = MAVFTP(WaitingLink(script.connection), script.system, 1)  # a refusal ends when the client is idle
    assert files.cmd_rm([GENERAL]).error_code == FtpError.FileProtected
    assert files.cmd_mkdir(["/somewhere"]).error_code == FtpError.FileProtected
    files.cmd_get(["/no/such/file", str(tmp_path / "nothing")])
    assert files.process_ftp_reply("get", timeout=BOUND_S).error_code == FtpError.FileNotFound


def test_a_log_is_listed_and_fetched_by_both_protocols(
    script: Witness, station_vehicle: RealVehicle, files: MAVFTP, tmp_path: Path
) -> None:
    script.arm()
    script.connection.arducopter_disarm()
    script.connection.motors_disarmed_wait()
    script.mav.log_request_list_send(script.system, 1, 0, 0xFFFF)
    entry = script.until("LOG_ENTRY", lambda entry: entry.id == entry.last_log_num)
    log = max(station_vehicle.log.parent.glob("*.ulg"), key=lambda path: path.stat().st_mtime_ns)
    assert (entry.size, entry.num_logs) == (log.stat().st_size, len(names(files, LOGS_FLAT)))
    script.mav.log_request_data_send(script.system, 1, entry.id, 0, 0xFFFFFFFF)
    content = bytearray()
    while len(content) < entry.size:
        part = script.until("LOG_DATA")
        assert (part.id, part.ofs) == (entry.id, len(content))  # TCP loses and swaps nothing
        content += bytes(part.data[: part.count])
    script.mav.log_request_end_send(script.system, 1)
    assert content == log.read_bytes()
    assert part.count == (entry.size % LOG_DATA_SIZE or LOG_DATA_SIZE)
    assert fetch(files, f"{LOGS_FLAT}/{log.name}", tmp_path / "by-ftp.ulg") == content
