"""The firmware on the emulated Cortex-M4F, through the same octets as on a serial port."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import pytest

from flightstack.firmware import emulator
from flightstack.firmware.emulator import EmulationError, Emulator
from flightstack.firmware.sources import source_hash
from flightstack.firmware.toolchain.cortex_m4 import (
    cortex_m4_image,
    emulated_image,
    emulated_target,
    instruction_counter,
)
from flightstack.firmware.toolchain.elf import Elf, ElfError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from tests.firmware.step_streams import random_steps

TROUBLE = Path(__file__).parent / "c" / "emulated_trouble.c"


class Host:
    """The other end of the target's link."""

    def __init__(self, now_s: float | None = None) -> None:
        self.now_s = now_s
        self.target = emulated_target(None if now_s is None else lambda: self.now_s)
        self.link = Link(255, 190)

    def send(self, message: Message) -> None:
        self.target.write(self.link.encode(message))

    def heard(self, timeout_s: float = 0.0) -> list[Message]:
        return list(self.link.decode(self.target.read(timeout_s)))

    def of(self, kind: str, timeout_s: float = 0.0) -> list[Message]:
        return [message for message in self.heard(timeout_s) if message.get_type() == kind]


def request(message_id: int) -> Message:
    return mavlink.MAVLink_command_long_message(1, 1, 512, 0, message_id, 0, 0, 0, 0, 0, 0)


def test_it_says_what_it_is() -> None:
    host = Host()
    host.send(request(mavlink.MAVLINK_MSG_ID_FS_PIL_IDENTITY))
    (identity,) = host.of("FS_PIL_IDENTITY")
    assert bytes(identity.source_hash) == source_hash()
    assert (identity.cost_unit, identity.real_octets, identity.char_bits, identity.clock_hz) == (2, 4, 8, 0)
    assert identity.board.startswith("emulated Cortex-M4F")
    assert "clang" in identity.compiler or "zig" in identity.compiler


def test_a_step_is_answered_at_once_with_what_its_stages_cost() -> None:
    host = Host()
    host.heard()
    host.target.write(random_steps(1, seed=1)[1])
    (report,) = host.of("FS_PIL_REPORT")
    outer, inner, mixer, whole = report.cycles
    assert min(outer, inner, mixer) > 100
    assert outer + inner + mixer < whole < outer + inner + mixer + 1000
    host.target.write(random_steps(1, seed=1)[1])
    (again,) = host.of("FS_PIL_REPORT")
    assert again.status & 0x10000, "REPEATED"
    assert again.rotor_command == report.rotor_command


def test_time_is_simulated_and_waiting_takes_none() -> None:
    host = Host()
    host.heard()
    beats = sum(len(host.of("HEARTBEAT", timeout_s=0.25)) for _ in range(4000))
    assert beats == pytest.approx(1000, abs=2)


def test_time_can_be_the_flights() -> None:
    host = Host(now_s=0.0)
    host.heard()
    host.now_s = 0.9
    assert host.heard(timeout_s=100.0) == []
    host.now_s = 1.1
    assert {message.get_type() for message in host.heard()} >= {"HEARTBEAT", "FS_PIL_STATUS"}


def test_the_same_octets_bring_the_same_octets_and_counts() -> None:
    def sent() -> bytes:
        target = emulated_target()
        frames = random_steps(200, seed=2)
        answers = []
        for frame in frames:
            target.write(frame)
            answers.append(target.read(0.1))
        return b"".join(answers)

    assert sent() == sent()


def test_a_whole_list_of_parameters_comes_in_one_piece() -> None:
    host = Host()
    host.heard()
    host.send(mavlink.MAVLink_param_request_list_message(1, 1))
    values = [message for _ in range(1000) for message in host.of("PARAM_VALUE", timeout_s=0.01)]
    assert [value.param_index for value in values] == list(range(values[0].param_count))


def test_its_stack_has_room() -> None:
    host = Host()
    for frame in random_steps(300, seed=3):
        host.target.write(frame)
    host.send(request(mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS))
    status = host.of("FS_PIL_STATUS")[-1]
    assert status.stack_size == 16 * 1024
    assert 0 < status.stack_high_water <= host.target.stack_high_water < 4096  # measured: 1200


@cache
def trouble() -> Path:
    state = hashlib.sha256(TROUBLE.read_bytes()).hexdigest()[:15]
    return emulated_image("trouble.elf", [TROUBLE], flags=[f"-DTROUBLE_STATE=0x{state}"])


def troubled() -> Emulator:
    return Emulator(trouble(), instruction_counter())


def test_instructions_are_counted_exactly() -> None:
    together, apart = troubled().exchange(b"c", 0)
    assert apart - together == 7


@pytest.mark.parametrize("octet", [b"w", b"n"], ids=["a write to nowhere", "a call to nowhere"])
def test_a_fault_is_a_sentence(octet: bytes) -> None:
    target = troubled()
    assert target.exchange(b"", 0) == b"y"
    with pytest.raises(EmulationError, match="stopped at 0x"):
        target.exchange(octet, 0)


def test_a_target_that_does_not_come_back_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emulator, "LONGEST_RUN", 100_000)
    target = troubled()
    with pytest.raises(EmulationError, match="did not return"):
        target.exchange(b"l", 0)


def test_a_target_that_sends_without_end_is_stopped() -> None:
    with pytest.raises(EmulationError, match="endlessly"):
        troubled().exchange(b"m", 0)


def test_an_image_that_is_none_is_refused(tmp_path: Path) -> None:
    image = cortex_m4_image().read_bytes()
    for name, content in {
        "empty": b"",
        "text": b"no executable at all, but long enough to be looked at" * 4,
        "cut": image[:3000],
        "for another processor": image[:18] + b"\x3e\x00" + image[20:],
    }.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(EmulationError, match="cannot be emulated"):
            Emulator(path, instruction_counter())


def test_no_damage_to_an_image_raises_anything_else() -> None:
    image = cortex_m4_image().read_bytes()[:4096]
    for at in range(0, 1024):
        damaged = bytearray(image)
        damaged[at] ^= 0xFF
        with pytest.raises(ElfError):
            Elf(bytes(damaged))
