"""``gcs pil build``: the firmware for a board.

A module of its own: its compilers need unicorn, which the other commands of ``gcs pil`` do without.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from flightstack.firmware.law_tree import controller_named, firmware_for
from flightstack.firmware.sources import source_hash
from flightstack.firmware.toolchain.boards import BOARDS, GCC, ZIG, board_image, flash_file
from flightstack.firmware.toolchain.build import BuildError
from gcs_cli.errors import USAGE, CliError
from gcs_cli.output import Output


def run_build(board: str, controller: str, baud: int, compiler: str, out: Path | None, as_json: bool) -> None:
    """Write the firmware of a board as ELF and as the file that its drive takes; raise CliError, ConfigError."""
    if board not in BOARDS:
        raise CliError(f"{board}: expected {', '.join(BOARDS)}", USAGE)
    if compiler not in (ZIG, GCC):
        raise CliError(f"--compiler {compiler}: expected {ZIG} or {GCC}", USAGE)
    folder = out or Path("build") / board
    try:
        with firmware_for(controller_named(controller)):
            image = board_image(board, compiler, baud)
            suffix, content = flash_file(board, image)
            sources = source_hash().hex()
        folder.mkdir(parents=True, exist_ok=True)
        elf, flash = folder / f"{board}.elf", folder / f"{board}.{suffix}"
        shutil.copyfile(image, elf)
        flash.write_bytes(content)
    except BuildError as error:
        raise CliError(str(error), USAGE) from None
    except OSError as error:
        raise CliError(f"{folder}: cannot be written: {error.strerror}") from None
    Output(as_json).say(
        "firmware",
        f"{BOARDS[board].title} with {controller}, {baud} baud, sources {sources}: copy {flash} to its drive\n"
        f"{elf} is for a debugger; then: gcs pil doctor --conformance --port DEVICE --baud {baud}",
        board=board, controller=controller, baud=baud, source_hash=sources, elf=str(elf), flash=str(flash),
        size_bytes=len(content),
    )  # fmt: skip
