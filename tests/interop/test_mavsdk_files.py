"""MAVSDK lists and fetches logs, by the log protocol and by MAVLink FTP, and reads the vehicle's files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mavsdk.plugins.ftp import FtpError, FtpResult
from mavsdk.plugins.log_files import LogFilesResult
from pyulog import ULog

from flightstack.services.files.component_metadata import GENERAL, LOGS_DATED, LOGS_FLAT
from tests.interop.client import API, TCP, Client
from tests.interop.drone import Drone


async def fetch_log(drone: Drone, directory: str, flies: bool) -> None:
    """Fly, or only arm, and fetch that log twice: by the log protocol, and as a file in bursts."""
    if flies:
        await drone.take_off()
        await drone.land()
    else:
        await drone.arm()
        await drone.action.disarm()
        await drone.until_disarmed()
    newest = (await drone.log_files.get_entries())[-1]
    drone.step(f"fetching log {newest}")
    async for result, progress in drone.log_files.download_log_file(newest, f"{directory}/by-log.ulg"):
        assert result in (LogFilesResult.NEXT, LogFilesResult.SUCCESS), (result, progress)
    listed = (await drone.ftp.list_directory(LOGS_FLAT)).entries
    (name,) = (entry.name for entry in listed if entry.size_bytes == newest.size_bytes)
    await fetch_file(drone, f"{LOGS_FLAT}/{name}", directory, burst=True)


async def fetch_file(drone: Drone, path: str, directory: str, burst: bool) -> None:
    """Fetch a file, or raise FtpError."""
    drone.step(f"fetching {path}")
    async for result, progress in drone.ftp.download(path, directory, burst):
        assert result in (FtpResult.NEXT, FtpResult.SUCCESS), (result, progress)


fetch_log.story = fetch_log  # type: ignore[attr-defined]  # run by the test below


@pytest.mark.parametrize(
    ("client", "flies"),
    [((10.0, API), True), ((1.0, TCP), False)],
    indirect=("client",),
    ids=("a flight over UDP", "armed only over TCP"),
)
def test_a_log_comes_byte_for_byte(client: Client, flies: bool, tmp_path: Path) -> None:
    client.run(fetch_log, directory=str(tmp_path), flies=flies)
    log = newest_log(client)
    assert (tmp_path / "by-log.ulg").read_bytes() == log.read_bytes()
    assert (tmp_path / log.name).read_bytes() == log.read_bytes()
    assert ULog(str(log)).data_list


def newest_log(client: Client) -> Path:
    """Return the vehicle's own file of its latest flight."""
    return max(client.vehicle.log.parent.glob("*.ulg"), key=lambda path: path.stat().st_mtime_ns)


async def fetch_from_a_day(drone: Drone, directory: str) -> None:
    """Fetch the log from where PX4 keeps logs: in a directory for each day."""
    days = (await drone.ftp.list_directory(LOGS_DATED)).entries
    day = f"{LOGS_DATED}/{days[-1].name}"
    first = (await drone.ftp.list_directory(day)).entries[0]
    await fetch_file(drone, f"{day}/{first.name}", directory, burst=True)


fetch_from_a_day.story = fetch_from_a_day  # type: ignore[attr-defined]


@pytest.mark.parametrize("client", [(1.0, TCP)], indirect=True, ids=(TCP,))
def test_logs_lie_where_px4_keeps_them(client: Client, tmp_path: Path) -> None:
    """It stands behind the tests that leave logs."""
    client.run(fetch_from_a_day, directory=str(tmp_path))
    (fetched,) = tmp_path.iterdir()
    assert fetched.read_bytes() == (client.vehicle.log.parent / fetched.name).read_bytes()


async def fetch_metadata(drone: Drone, directory: str) -> None:
    """Fetch a file that the vehicle makes up, plainly and in bursts."""
    for burst in (False, True):
        folder = Path(directory) / str(burst)
        folder.mkdir()
        await fetch_file(drone, f"/{GENERAL}", str(folder), burst)


fetch_metadata.story = fetch_metadata  # type: ignore[attr-defined]


@pytest.mark.parametrize("client", [(1.0, API), (1.0, TCP)], indirect=True, ids=(API, TCP))
def test_the_vehicles_metadata_is_read_as_a_file(client: Client, tmp_path: Path) -> None:
    client.run(fetch_metadata, directory=str(tmp_path))
    plain, burst = ((tmp_path / folder / Path(GENERAL).name).read_bytes() for folder in ("False", "True"))
    assert plain == burst
    assert json.loads(plain)["version"] == 1


async def miss_and_write(drone: Drone, directory: str) -> None:
    """Fetch a file that is not there, and try to change what is."""
    with pytest.raises(FtpError) as missing:
        await fetch_file(drone, "/no/such/file", directory, burst=False)
    assert missing.value.result.name == "FILE_DOES_NOT_EXIST", missing.value
    for change in (drone.ftp.create_directory("/somewhere"), drone.ftp.remove_file(f"/{GENERAL}")):
        with pytest.raises(FtpError) as protected:
            await change
        assert protected.value.result.name == "FILE_PROTECTED", protected.value


miss_and_write.story = miss_and_write  # type: ignore[attr-defined]


@pytest.mark.parametrize("client", [(1.0, API)], indirect=True, ids=(API,))
def test_what_is_not_there_and_what_would_change_a_file_is_refused(client: Client, tmp_path: Path) -> None:
    client.run(miss_and_write, directory=str(tmp_path))
