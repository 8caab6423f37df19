"""The same steps on host, emulated Cortex-M4F, AVR and aarch64; each tells the hash of all its reports so far."""

from __future__ import annotations

import functools
import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.firmware.emulator import MAX_RECEIVED, Emulator
from flightstack.firmware.sources import c_files, firmware_root
from flightstack.firmware.toolchain.build import EXACT, cached, host_compiler, includes
from flightstack.firmware.toolchain.cortex_m4 import emulated_image, instruction_counter
from tests.firmware.kept_builds import kept_build
from tests.support.tools import missing

C = Path(__file__).parent / "c"
LOOPS = [*c_files("core"), *c_files("mavlink")]
STEPS = [C / "steps.c", C / "steps_parameters.c"]
INCLUDES = [*includes("core", "mavlink"), f"-I{C}"]
STAGES = ("outer", "inner", "mixer", "whole")
LIMIT_S = 3600.0


class Costs(NamedTuple):
    """Instructions of outer loop, inner loop, mixer and whole step: the most, and the mean of all steps."""

    most: dict[str, int]
    mean: dict[str, float]


def tool(name: str, package: str) -> str:
    """Return a tool's path; without it the test is skipped, but on CI, which installs it, it fails."""
    found = shutil.which(name)
    if found is None:
        missing(f"{name} is not installed (apt install {package})")
    return found


def state_flag(*sources: Path) -> str:
    """A definition that is another one whenever a file of the tests is: ``cached`` knows the firmware's files alone."""
    content = b"".join(path.read_bytes() for path in (*sources, C / "steps.h"))
    return f"-DSTEPS_STATE=0x{hashlib.sha256(content).hexdigest()[:15]}"


def run(command: Sequence[str | Path]) -> str:
    """Run a tool and return what it wrote to stderr; fail with that when the tool does."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, timeout=LIMIT_S)
    assert done.returncode == 0, f"{command[0]}: {done.stderr}{done.stdout}"
    return done.stderr


def hashes(octets: bytes) -> np.ndarray:
    """Return the hash after each step, and at the end the number of parameters that were refused."""
    return np.frombuffer(octets, "<u4")


def on_host(stream: bytes, folder: Path) -> np.ndarray:
    """Run the steps on this machine."""
    sources = [*LOOPS, *STEPS, C / "steps_host.c"]
    flags = [*EXACT, *INCLUDES, state_flag(*sources)]
    program = cached("steps_host", host_compiler(), flags, sources)
    (folder / "steps").write_bytes(stream)
    run([program, folder / "steps", folder / "host"])
    return hashes((folder / "host").read_bytes())


@functools.cache
def zig_image() -> Path:
    """Return the steps for the emulator, compiled by zig as the application is."""
    sources = [*LOOPS, *STEPS, C / "steps_cortex_m4.c"]
    return emulated_image("steps.elf", sources, flags=[f"-I{C}", state_flag(*sources)])


def gcc_image() -> Path:
    """Return the steps for the emulator, compiled by gcc file by file."""
    compiler = tool("arm-none-eabi-gcc", "gcc-arm-none-eabi")
    port = firmware_root() / "ports" / "cortex_m4"
    cpu = [
        "-mthumb",
        "-mcpu=cortex-m4",
        "-mfpu=fpv4-sp-d16",
        "-mfloat-abi=hard",
        "-nostdlib",
        "-Wl,--gc-sections",
    ]
    link = [f"-Wl,-T,{port / 'emulated.ld'}", "-Wl,-e,fs_emulated_exchange", "-ffunction-sections"]
    own = [port / "emulated_start.c", port / "support.c", C / "steps_cortex_m4.c"]
    flags = [*cpu, *link, *EXACT, *INCLUDES, f"-I{port}"]
    return kept_build("steps_gcc.elf", (compiler,), *flags, *LOOPS, *STEPS, *own, "-lgcc")


def on_cortex_m4(stream: bytes, image: Path) -> tuple[np.ndarray, Costs]:
    """Run the steps on the emulated Cortex-M4F."""
    emulator = Emulator(image, instruction_counter())
    pieces = (stream[at : at + MAX_RECEIVED] for at in range(0, len(stream), MAX_RECEIVED))
    results = hashes(
        b"".join([emulator.exchange(piece, 0) for piece in pieces] + [emulator.exchange(b"", 0)])
    )
    end = len(results) - 2 * len(STAGES)
    most, total = results[end : end + len(STAGES)], results[end + len(STAGES) :]
    steps = end - 1
    return results[:end], Costs(
        {stage: int(cost) for stage, cost in zip(STAGES, most, strict=True)},
        {stage: float(cost) / steps for stage, cost in zip(STAGES, total, strict=True)},
    )


def avr_program(name: str, *words: str | Path) -> Path:
    """Return a program for a simulated ATmega1284P."""
    compiler = tool("avr-gcc", "gcc-avr avr-libc")
    return kept_build(
        name, (compiler, "-mmcu=atmega1284p"), "-ffunction-sections", "-Wl,--gc-sections", *words
    )


def run_avr(program: Path, stream: bytes, folder: Path) -> np.ndarray:
    """Give octets to a program on a simulated ATmega1284P; return the hashes."""
    tool("simavr", "simavr libsimavr-dev")
    if not Path("/usr/include/simavr/sim_avr.h").exists():
        tool("libsimavr-dev", "libsimavr-dev")
    simulator = kept_build("avr_simulator", host_compiler().command, "-O2", C / "avr_simulator.c", "-lsimavr")
    (folder / "stream").write_bytes(stream)
    run([simulator, program, folder / "stream", folder / "avr"])
    return hashes((folder / "avr").read_bytes())


def on_avr(stream: bytes, folder: Path) -> np.ndarray:
    """Run the steps on a simulated ATmega1284P, whose int has 16 bits and whose float arithmetic is a library."""
    program = avr_program("steps_avr.elf", *EXACT, *INCLUDES, *LOOPS, *STEPS, C / "steps_avr.c")
    return run_avr(program, stream, folder)


def aarch64_program(name: str, *words: str | Path) -> Path:
    """Return a program for aarch64, with its libraries in it."""
    compiler = tool("aarch64-linux-gnu-gcc", "gcc-aarch64-linux-gnu libc6-dev-arm64-cross")
    return kept_build(name, (compiler, "-static"), *words)


def on_aarch64(stream: bytes, folder: Path, contract: str = "off") -> np.ndarray:
    """Run the steps on aarch64 in QEMU; ``contract``: the value of -ffp-contract."""
    flags = [*EXACT, f"-ffp-contract={contract}", *INCLUDES]
    elf = aarch64_program("steps_aarch64", *flags, *LOOPS, *STEPS, C / "steps_host.c")
    (folder / "steps").write_bytes(stream)
    run([tool("qemu-aarch64", "qemu-user"), elf, folder / "steps", folder / "aarch64"])
    return hashes((folder / "aarch64").read_bytes())


def first_difference(one: np.ndarray, other: np.ndarray) -> str:
    """Say at which step two machines begin to differ; the empty text if they never do."""
    if len(one) != len(other):
        return f"{len(one)} and {len(other)} results"
    apart = np.flatnonzero(one != other)
    return f"step {apart[0]} of {len(one) - 1}" if apart.size else ""
