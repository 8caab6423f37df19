"""Firmware for boards: it compiles without a warning, and its files are what boot ROMs and boot drives take."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from flightstack.firmware.toolchain import boards
from flightstack.firmware.toolchain.boards import (
    BOARDS,
    board_compilers,
    board_image,
    raw_image,
    uf2_image,
)
from flightstack.firmware.toolchain.build import BuildError
from flightstack.firmware.toolchain.elf import Elf
from gcs_cli.errors import DONE, USAGE
from tests.firmware.board_builds import image
from tests.support.commands import gcs
from tests.support.tools import NIGHTLY

BUILDS = [
    (name, each) for name in BOARDS for each in board_compilers(name) if NIGHTLY or name != "pico2-riscv"
]


@pytest.mark.parametrize(("name", "compiler"), BUILDS)
def test_boards_compile_without_a_warning(name: str, compiler: str) -> None:
    start, data = raw_image(Elf(image(name, compiler).read_bytes()))
    assert start == (0x1000_0000 if "pico2" in name else 0x0800_0000)
    assert len(data) < 64 * 1024


@pytest.mark.parametrize("baud", [2_550_000, 3_000_000, 300])
def test_a_rate_that_the_uart_misses_stops_the_build(baud: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards, "c_files", lambda _: [])  # the board's own files are enough to stop it
    with pytest.raises(BuildError, match="NUCLEO_BAUD"):
        board_image("nucleo-f446re", baud=baud)


def test_uf2_blocks_hold_the_image_with_the_boards_family() -> None:
    data = bytes(range(256)) * 3 + b"end"
    blocks = uf2_image(0x1000_0000, data, 0xE48B_FF59)
    assert len(blocks) == 4 * 512
    content = b""
    for number in range(4):
        block = blocks[512 * number : 512 * (number + 1)]
        assert struct.unpack_from("<8I", block) == (
            *(0x0A32_4655, 0x9E5D_5157, 0x2000, 0x1000_0000 + 256 * number, 256, number, 4, 0xE48B_FF59),
        )
        assert block[-4:] == bytes.fromhex("306fb10a")
        content += block[32 : 32 + 256]
    assert content.rstrip(b"\xff") == data


def test_gcs_builds_for_a_board(tmp_path: Path) -> None:
    done = gcs("pil", "build", "pico2", "--out", tmp_path, "--json")
    assert done.returncode == DONE, done.stdout + done.stderr
    told = json.loads(done.stdout)
    assert Path(told["flash"]).read_bytes()[:4] == b"UF2\n"
    assert Path(told["elf"]).read_bytes()[:4] == b"\x7fELF"
    assert told["size_bytes"] == Path(told["flash"]).stat().st_size


@pytest.mark.parametrize(
    "words", [["uno"], ["pico2", "--compiler", "msvc"], ["pico2-riscv", "--compiler", "gcc"]]
)
def test_gcs_names_boards_and_compilers(words: list[str], tmp_path: Path) -> None:
    done = gcs("pil", "build", *words, "--out", tmp_path / "out")
    assert done.returncode == USAGE
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
