"""The signing key's files, and SETUP_SIGNING, which changes them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Hashable
from contextlib import ExitStack
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from flightstack.mavlink.signing import KEEP_TICKS, NO_KEY, Signing, timestamp_of
from flightstack.process.signing_file import (
    create_key,
    load_key,
    open_shared_signing,
    open_signing,
    replace_key,
)
from flightstack.services.routing.signing_setup import SigningSetup

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "vehicle.key"
    path.write_text(KEY.hex() + "\n")
    path.chmod(0o600)
    return path


def test_a_new_key_is_random_and_for_its_owner_alone(tmp_path: Path) -> None:
    first, second = tmp_path / "keys" / "first.key", tmp_path / "second.key"
    before = os.umask(0)
    try:
        keys = {create_key(first), create_key(second)}
    finally:
        os.umask(before)
    assert len(keys) == 2
    assert first.stat().st_mode & 0o777 == 0o600
    assert {load_key(first), load_key(second)} == keys
    with pytest.raises(ConfigError, match="File exists"):
        create_key(first)


@pytest.mark.parametrize("content", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\r\n"])
def test_a_key_is_raw_or_hexadecimal(key_file: Path, content: bytes) -> None:
    key_file.write_bytes(content)
    assert load_key(key_file) == KEY


@pytest.mark.parametrize(
    "content", [b"", KEY[:31], KEY + b"x", KEY.hex().encode()[:-1], b"\xff" * 64, b"z" * 64, b"0" * 9999]
)
def test_any_other_content_is_refused(key_file: Path, content: bytes) -> None:
    key_file.write_bytes(content)
    with pytest.raises(ConfigError, match="32 bytes or 64 hexadecimal digits"):
        load_key(key_file)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601, 0o666])
def test_a_key_that_others_may_use_is_refused(key_file: Path, mode: int) -> None:
    key_file.chmod(mode)
    with pytest.raises(ConfigError, match=f"chmod 600 {key_file}"):
        load_key(key_file)


def test_a_missing_key_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none.key: No such file"):
        load_key(tmp_path / "none.key")


def test_timestamps_go_on_after_a_crash_and_after_an_orderly_end(key_file: Path) -> None:
    first = open_signing(key_file, "vehicle")
    used = first.next_timestamp()
    second = open_signing(key_file, "vehicle")  # the first one crashed
    assert used < second.next_timestamp() <= timestamp_of(time.time())
    second.close()
    third = open_signing(key_file, "vehicle")
    assert third.next_timestamp() > second.timestamp
    timestamps = key_file.with_name("vehicle.key.vehicle.timestamp")
    assert timestamps.stat().st_mode & 0o777 == 0o600
    assert sorted(path.name for path in key_file.parent.iterdir()) == [key_file.name, timestamps.name]


def test_timestamps_of_processes_that_share_a_key_stay_with_the_clock(key_file: Path) -> None:
    """Each run took a minute in advance, until the vehicle refused all: two minutes after three runs."""
    long_lived = open_shared_signing(key_file, "gcs").signing
    used = [long_lived.next_timestamp()]
    for _ in range(5):
        before = timestamp_of(time.time())
        one, other = (open_shared_signing(key_file, "gcs").signing for _ in range(2))
        used += [one.next_timestamp(), other.next_timestamp()]
        assert before <= used[-2] <= timestamp_of(time.time()) + len(used)
        one.close()
    assert long_lived.next_timestamp() <= timestamp_of(time.time()) + len(used)


def test_a_kept_timestamp_never_goes_back(key_file: Path) -> None:
    """A process that ends late keeps the timestamp of another one that was ahead."""
    first, second = (open_shared_signing(key_file, "gcs").signing for _ in range(2))
    first.next_timestamp()
    second.set_key(KEY, timestamp_of(time.time()) + 50)
    second.close()
    first.close()
    assert open_shared_signing(key_file, "gcs").signing.timestamp == second.timestamp


def test_a_timestamp_ahead_of_the_clock_is_restored(key_file: Path) -> None:
    ahead = timestamp_of(time.time()) + 10**7
    key_file.with_name("vehicle.key.gcs.timestamp").write_text(f"{ahead}\n")
    assert open_shared_signing(key_file, "gcs").signing.next_timestamp() == ahead + 1


def test_processes_that_share_a_key_have_different_link_ids(key_file: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from flightstack.process.signing_file import open_shared_signing\n"
        "link = open_shared_signing(Path(sys.argv[1]), 'gcs'); print(link.link_id, flush=True); sys.stdin.read()"
    )
    drawn = (0, 100, 239, 239)  # the random numbers with which each begins its search
    with ExitStack() as running:
        found = []
        for number in drawn:
            command = [
                sys.executable,
                "-c",
                f"import secrets; secrets.randbelow = lambda _: {number}\n{program}",
            ]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            process = running.enter_context(subprocess.Popen([*command, str(key_file)], **pipes))
            assert process.stdin is not None
            assert process.stdout is not None
            running.callback(process.stdin.close)
            found.append(int(process.stdout.readline()))
    assert found == [16, 116, 255, 17]


def test_two_processes_with_one_key_do_not_share_a_timestamp(key_file: Path) -> None:
    vehicle, ground = open_signing(key_file, "vehicle"), open_signing(key_file, "gcs")
    vehicle.next_timestamp()
    ground.next_timestamp()
    assert len(list(key_file.parent.iterdir())) == 3


@pytest.mark.parametrize("content", [b"", b"x", b"-1", b"9" * 16, b"\xff"])
def test_a_damaged_timestamp_file_is_not_passed_over(key_file: Path, content: bytes) -> None:
    key_file.with_name("vehicle.key.vehicle.timestamp").write_bytes(content)
    with pytest.raises(ConfigError, match=r"vehicle.key.vehicle.timestamp"):
        open_signing(key_file, "vehicle")


def test_disk_error_in_flight_is_reported_once(key_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    signing = open_signing(key_file, "vehicle")
    (key_file.parent / "vehicle.key.vehicle.timestamp").unlink()
    (key_file.parent / "vehicle.key.vehicle.timestamp").mkdir()  # no file can take its place
    signing.next_timestamp()
    signing.set_key(KEY, signing.timestamp + 2 * KEEP_TICKS)
    signing.next_timestamp()
    assert capsys.readouterr().err.count("after a crash, signed messages may be refused") == 1


# ---------------------------------------------------------------------- SETUP_SIGNING


class Setup:
    """The service with a vehicle that is what the test says."""

    def __init__(self, key_file: Path | None) -> None:
        self.signing = None if key_file is None else open_signing(key_file, "vehicle")
        self.key_file = key_file
        self.armed = False
        self.said: list[str] = []
        self.service = SigningSetup(Address(1, 1), lambda: self.armed, self.is_secure, self.said.append)
        if self.signing is not None:
            self.service.use(self.signing, self.store)

    @staticmethod
    def is_secure(peer: Hashable) -> bool:
        return peer == "loopback"

    def store(self, key: bytes) -> None:
        assert self.key_file is not None
        replace_key(self.key_file, key)

    def send(
        self,
        key: bytes,
        timestamp: int = 0,
        peer: str = "loopback",
        target: tuple[int, int] = (1, 1),
        signed: bool = True,
    ) -> list[str]:
        self.said.clear()
        message = mavlink.MAVLink_setup_signing_message(*target, list(key), timestamp)
        message.get_header().incompat_flags = mavlink.MAVLINK_IFLAG_SIGNED if signed else 0
        self.service.receive(message, peer, 0.0)
        assert self.service.poll(0.0) == []
        assert self.service.next_deadline() is None
        return self.said


def test_a_new_key_is_used_and_kept(key_file: Path) -> None:
    setup = Setup(key_file)
    assert setup.send(OTHER_KEY, 5 * 10**13) == ["Signing is on: a new key is in use"]
    assert setup.signing is not None
    assert setup.signing.timestamp == 5 * 10**13
    assert load_key(key_file) == OTHER_KEY
    assert key_file.stat().st_mode & 0o777 == 0o600


def test_a_key_of_zeros_switches_signing_off_also_after_a_restart(key_file: Path) -> None:
    setup = Setup(key_file)
    assert setup.send(NO_KEY) == ["Signing is off"]
    assert setup.signing is not None
    assert not setup.signing.is_on
    assert not open_signing(key_file, "vehicle").is_on
    assert setup.send(OTHER_KEY) == ["Signing is on: a new key is in use"]


def test_an_armed_vehicle_keeps_its_key(key_file: Path) -> None:
    setup = Setup(key_file)
    setup.armed = True
    assert setup.send(OTHER_KEY) == ["Signing key refused: the vehicle is armed"]
    assert load_key(key_file) == KEY


def test_a_key_from_a_network_is_refused(key_file: Path) -> None:
    setup = Setup(key_file)
    assert setup.send(OTHER_KEY, peer="192.0.2.1") == ["Signing key refused: the link is not local"]
    assert load_key(key_file) == KEY


def test_only_key_holder_changes_key(key_file: Path) -> None:
    setup = Setup(key_file)
    refusal = "Signing key refused: the message is not signed with the present key"
    assert setup.send(OTHER_KEY, signed=False) == [refusal]
    assert load_key(key_file) == KEY
    assert setup.send(NO_KEY) == ["Signing is off"]
    assert setup.send(OTHER_KEY, signed=False) == ["Signing is on: a new key is in use"]  # the first one


@pytest.mark.parametrize("target", [(0, 0), (0, 1), (2, 1), (1, 2)])
def test_a_key_for_everyone_or_another_is_ignored(key_file: Path, target: tuple[int, int]) -> None:
    setup = Setup(key_file)
    assert setup.send(OTHER_KEY, target=target) == []
    assert load_key(key_file) == KEY


def test_a_key_that_cannot_be_kept_is_not_used(key_file: Path) -> None:
    setup = Setup(key_file)
    key_file.unlink()
    key_file.mkdir()
    (said,) = setup.send(OTHER_KEY)
    assert said.startswith("Signing key refused: it cannot be kept: ")
    assert setup.signing is not None
    assert setup.signing.accepts(Signing(KEY, time.time).sign(b"\xfd" + bytes(11), 0, 0))


def test_without_a_key_file_no_key_is_taken() -> None:
    assert Setup(None).send(OTHER_KEY) == [
        "Signing key refused: flightstack was started without --signing-key"
    ]
