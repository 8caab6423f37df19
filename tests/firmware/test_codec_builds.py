"""The C codec under sanitisers, a fuzzer, gcov and on another processor."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.firmware.codec_fuzz import LARGEST_INPUT, fuzzer
from tests.firmware.codec_support import (
    HARNESS,
    SOURCES,
    WARNINGS,
    compile_c,
    compiler,
    sealed,
    stream,
)
from tests.support.tools import NIGHTLY, missing

SHIM, DRIVER = HARNESS / "codec_shim.c", HARNESS / "codec_driver.c"
UNDEFINED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]
SAME_EVERYWHERE = "be735754"
"""What codec_self_hash prints: on a host with gcc and clang, on a Cortex-M4, on an AVR, whose int has 16 bits."""


def test_nothing_is_decided_by_memory_that_was_never_written(tmp_path: Path) -> None:
    """MemorySanitizer, which clang alone has: a candidate frame lies on the stack and is filled in step by step."""
    flags = ["-fsanitize=memory", "-fno-sanitize-recover=all", "-g", "-O1"]
    program = compile_c(
        tmp_path / "driver", [*SOURCES, SHIM, DRIVER], *flags, *WARNINGS, cc=compiler("clang")
    )
    done = subprocess.run([program], input=stream(11, 3_000), check=False, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_nothing_undefined_happens(name: str, tmp_path: Path) -> None:
    """Parse, decode and encode a damaged stream in all eight ways; a sanitiser that sees a fault ends it."""
    program = compile_c(
        tmp_path / "driver", [*SOURCES, SHIM, DRIVER], *UNDEFINED, "-O1", *WARNINGS, cc=compiler(name)
    )
    done = subprocess.run([program], input=stream(11, 3_000), check=False, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    ways = [tuple(map(int, line.split())) for line in done.stdout.decode().splitlines()]
    assert len(ways) == 8
    assert ways[1] == ways[3]  # poisoned or not
    assert ways[4] == ways[5] == ways[6] == ways[7]  # with silence at the end, eager or not
    assert min(way[0] for way in ways) > 1_000


FUZZ_RUNS = 50_000 if NIGHTLY else 15_000


def test_a_fuzzer_finds_nothing(tmp_path: Path) -> None:
    """15 000 inputs grown from frames, damaged frames and pieces of streams by day; `make fuzz-firmware` takes more.

    A limit of memory would judge this process: Linux gives its peak to the fuzzer. The codec allocates none.
    """
    limits = [f"-runs={FUZZ_RUNS}", f"-max_len={LARGEST_INPUT}", "-rss_limit_mb=0"]
    command = [fuzzer(tmp_path), *limits, "-seed=1", "corpus"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=240, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-3_000:]
    (runs,) = re.findall(r"Done (\d+) runs", done.stderr)
    assert int(runs) >= FUZZ_RUNS


def test_every_line_and_branch_is_run(tmp_path: Path) -> None:
    """No exception is listed: all of firmware/mavlink, both ways of every branch, by one driver."""
    if not shutil.which("gcov"):
        missing("no gcov on this machine")
    gcc = compiler("gcc")
    compile_c(tmp_path / "driver", [*SOURCES, SHIM, DRIVER], "--coverage", "-O0", "-std=c99", cc=gcc)
    # silence behind a beginning that waits, and behind an unknown message
    data = stream(12, 4_000) + b"\xfd\xff\x00" + sealed(54_321, bytes(30))
    subprocess.run(
        [tmp_path / "driver"], input=data, check=True, capture_output=True, cwd=tmp_path, timeout=60
    )
    notes = [f"driver-{source.stem}.gcno" for source in SOURCES]
    done = subprocess.run(
        ["gcov", "-b", *notes], check=True, capture_output=True, text=True, cwd=tmp_path, timeout=60
    )
    files = re.findall(r"File '[^']*/(\w+\.c)'\nLines executed:([\d.]+)%.*\n(.*\n.*)", done.stdout)
    assert sorted(name for name, _, _ in files) == [source.name for source in SOURCES]
    for name, lines, branches in files:
        assert float(lines) == 100.0, name
        for percent in re.findall(r"Taken at least once:([\d.]+)%", branches):
            assert float(percent) == 100.0, name


@pytest.mark.parametrize("optimise", ["-O0", "-O2"])
@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_compilers_agree(name: str, optimise: str, tmp_path: Path) -> None:
    program = compile_c(
        tmp_path / "hash", self_hash_sources(), optimise, "-std=c99", "-funsigned-char", cc=compiler(name)
    )
    printed = subprocess.run([program], check=True, capture_output=True, text=True, timeout=60).stdout
    assert printed.strip() == SAME_EVERYWHERE


def test_an_avr_agrees_where_an_int_has_16_bits(tmp_path: Path) -> None:
    """400 damaged frames through encoder, parser and decoder; every octet that comes of it is in the number."""
    avr = [*compiler("avr-gcc"), "-mmcu=atmega1284p"]
    if not shutil.which("simavr"):
        missing("no simavr on this machine")
    program = compile_c(tmp_path / "hash.elf", self_hash_sources(), "-O2", "-std=c99", cc=avr)
    command = ["simavr", "-m", "atmega1284p", "-f", "16000000", str(program)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    assert SAME_EVERYWHERE in done.stdout + done.stderr


def test_a_cortex_m4_agrees(tmp_path: Path) -> None:
    """The same in QEMU. The compiler must not make calls of loops: there is no C library to call."""
    cpu = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    bare = [
        "-std=gnu99",
        "-nostdlib",
        "-fno-tree-loop-distribute-patterns",
        f"-T{HARNESS / 'codec_cortex_m4.ld'}",
    ]
    arm = [*compiler("arm-none-eabi-gcc"), *cpu]
    if not shutil.which("qemu-system-arm"):
        missing("no qemu-system-arm on this machine")
    program = compile_c(tmp_path / "hash.elf", self_hash_sources(), "-O2", *bare, cc=arm)
    machine = ["-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "none"]
    semihosting = ["-semihosting-config", "enable=on,target=native", "-kernel", str(program)]
    command = ["qemu-system-arm", *machine, *semihosting]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    assert (done.stdout + done.stderr).strip() == SAME_EVERYWHERE


def self_hash_sources() -> list[Path]:
    return [*SOURCES, SHIM, HARNESS / "codec_self_hash.c"]
