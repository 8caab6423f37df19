"""The F28377S build without TI's tools: CMake with a stand-in for cl2000, the linker files, the CCS project."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from flightstack.firmware.sources import source_hash
from tests.firmware.f28377s_support import FIRMWARE, PORT, PORTABLE, RING
from tests.support.tools import missing

STAND_IN = """#!/bin/sh
printf '%s\\n' "$*" >> "$(dirname "$0")/../commands"
for word in "$@"; do
  case "$word" in --output_file=*|--preproc_dependency=*) : > "${word#*=}";; esac
done
"""
KNOWN = [
    *(f"-DCMAKE_{language}_COMPILER_ID=TI" for language in ("C", "ASM")),
    *("-DCMAKE_C_COMPILER_ID_RUN=1", "-DCMAKE_C_COMPILER_WORKS=1"),
    *("-DCMAKE_C_COMPILER_ARCHITECTURE_ID=TMS320C28x", "-DCMAKE_C_COMPILER_VERSION=22.6.0"),
    *("-DCMAKE_C_STANDARD_COMPUTED_DEFAULT=11", "-DCMAKE_C_EXTENSIONS_COMPUTED_DEFAULT=OFF"),
]
"""What CMake finds out by running cl2000."""
TI_FILES = tuple(
    name
    for family in ("F2837xS", "F2837xD")
    for name in (
        f"driverlib/{family.lower()}/driverlib/sci.h",
        f"driverlib/{family.lower()}/driverlib/ccs/Release/driverlib.lib",
        f"device_support/{family.lower()}/common/source/device.c",
        f"device_support/{family.lower()}/common/source/{family}_CodeStartBranch.asm",
    )
)


def configured(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run CMake with empty files in place of TI's, and a compiler that notes how it is called."""
    if not shutil.which("cmake"):
        missing("no cmake on this machine")
    for name in TI_FILES:
        (folder / "c2000ware" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "c2000ware" / name).touch()
    for name in ("cl2000", "ar2000"):
        tool = folder / "cgt" / "bin" / name
        tool.parent.mkdir(parents=True, exist_ok=True)
        tool.write_text(STAND_IN)
        tool.chmod(0o755)
    command = ["cmake", "-S", PORT, "-B", folder / "build", "--toolchain", PORT / "cmake" / "cl2000.cmake"]
    paths = [f"-DC2000_CGT_ROOT={folder / 'cgt'}", f"-DC2000WARE_ROOT={folder / 'c2000ware'}"]
    python = f"-DPython3_EXECUTABLE={sys.executable}"
    return subprocess.run(
        [*command, *paths, *KNOWN, python, *options], check=False, capture_output=True, text=True, timeout=120
    )


def commands(folder: Path, *options: str) -> list[str]:
    """Build; return how the compiler was called."""
    done = configured(folder, *options)
    assert done.returncode == 0, done.stderr
    built = subprocess.run(
        ["cmake", "--build", folder / "build"], check=False, capture_output=True, text=True, timeout=120
    )
    assert built.returncode == 0, built.stderr
    return (folder / "cgt" / "commands").read_text().splitlines()


def hash_in(header: Path) -> bytes:
    """Return the hash that a header gives to the compiler."""
    return bytes(int(octet, 16) for octet in re.findall(r"0x(\w\w)U", header.read_text()))


def test_every_source_is_compiled_as_the_core_demands(tmp_path: Path) -> None:
    calls = commands(tmp_path)
    for source in [*PORTABLE, RING, *PORT.glob("*.c")]:
        (call,) = [call for call in calls if f"/{source.name} " in call and "--c_file=" in call]
        for option in (
            "--abi=eabi",
            "--fp_mode=strict",
            "--c99",
            "--float_operations_allowed=32",
            "--fp_reassoc=off",
        ):
            assert option in call
        assert "-D_LAUNCHXL_F28377S" in call
    assert_linked(calls, "flash", 1536)
    (run,) = [call for call in calls if "/f28_run.c " in call]
    assert hash_in(Path(re.findall(r"--preinclude=(\S+)", run)[0])) == source_hash()


def assert_linked(calls: list[str], memory: str, stack_words: int) -> None:
    """Memory and stack are those of the linker; the painted stack is the linked one."""
    *compiled, link = calls
    assert "--run_linker" in link
    assert f"linker/{memory}.cmd" in link
    assert f"--stack_size={stack_words}" in link
    own = [call for call in compiled if "/f28_" in call]
    assert own
    assert all(f"-DF28_STACK_WORDS={stack_words}U" in call for call in own)
    assert all(("-D_FLASH" in call) == (memory == "flash") for call in own)


def test_every_option_of_the_build_has_its_effect(tmp_path: Path) -> None:
    """The other launchpad with its own files of TI, loops from RAM, the TMU, linked into RAM with another stack."""
    options = ("LAUNCHPAD=F28379D", "RAMFUNCS=ON", "MATH=relaxed", "MEMORY=ram", "STACK_WORDS=1024")
    calls = commands(tmp_path, *(f"-DF28_{option}" for option in options))
    own = [call for call in calls if "/f28_" in call and "--c_file=" in call]
    assert own
    assert all("-D_LAUNCHXL_F28379D" in call for call in own)
    assert not [call for call in calls if "2837xs" in call.lower()]
    assert any("/F2837xD_CodeStartBranch.asm" in call for call in calls)
    assert_linked(calls, "ram", 1024)
    compiled = [call for call in calls if "--c_file=" in call]
    in_ram = {
        Path(re.findall(r"--c_file=(\S+)", call)[0]).parent.name
        for call in compiled
        if "--ramfunc=on" in call
    }
    assert in_ram == {"core"}
    assert all("--fp_mode=relaxed" in call for call in compiled if "/core/" in call)


@pytest.mark.parametrize(
    ("option", "word"),
    [
        ("-DC2000WARE_ROOT=/nowhere", "C2000Ware not found"),
        ("-DF28_MEMORY=rom", "F28_MEMORY is flash or ram"),
        ("-DF28_LAUNCHPAD=F28335", "F28_LAUNCHPAD is F28377S or F28379D"),
        ("-DF28_MATH=fast", "F28_MATH is strict or relaxed"),
    ],
)
def test_what_is_missing_is_said_in_a_sentence(option: str, word: str, tmp_path: Path) -> None:
    done = configured(tmp_path, option)
    assert done.returncode != 0
    assert word in done.stderr


def regions(text: str) -> dict[str, range]:
    """Return the memory of a linker file."""
    found = re.findall(r"(\w+)\s*: origin = (0x\w+), length = (0x\w+)", text)
    return {name: range(int(first, 16), int(first, 16) + int(length, 16)) for name, first, length in found}


@pytest.mark.parametrize("name", ["ram", "flash"])
def test_the_linker_files_stay_within_the_chip(name: str) -> None:
    """Regions do not overlap and keep out of what is reserved; sections go to regions that exist; the stack is low."""
    text = re.sub(r"/\*.*?\*/", "", (PORT / "linker" / f"{name}.cmd").read_text(), flags=re.DOTALL)
    memory = regions(text)
    ordered = sorted(memory.values(), key=lambda region: region.start)
    assert all(a.stop <= b.start for a, b in itertools.pairwise(ordered))
    for region in memory.values():
        assert not (set(region[:1]) | set(region[-1:])) & set(range(2, 0x123))  # the boot ROM's
        assert region.stop <= 0x7F8 or region.start >= 0x8000  # the end of M1: fetched ahead
        assert region.stop <= 0x17FF8 or region.start >= 0x80000  # so is the end of GS11
        assert region.stop <= 0xBFFF0 or region.start >= 0x3FFFC0  # and of the bank of flash
    sections = text[text.index("SECTIONS") :]
    used = set(re.findall(r"\b(RAM\w+|FLASH|BEGIN|RESET)\b", sections)) - {"RAM"}
    assert used <= set(memory)
    stack = re.search(r"\.stack\s*: > (\w+), RUN_START\(f28_stack\)", sections)
    assert stack is not None
    assert memory[stack[1]].stop <= 0x10000  # the stack pointer has 16 bits
    assert len(memory[stack[1]]) >= 0x600
    for section in (".text", ".bss", ".data", ".const", ".cinit", ".TI.ramfunc", "codestart"):
        assert re.search(rf"^\s*{re.escape(section)}\s*:", sections, re.MULTILINE)


def test_the_ccs_project_lists_the_sources_and_options_of_cmake() -> None:
    root = ET.parse(PORT / "ccs" / "flightstack_f28377s.projectspec").getroot()
    project = root.find("project")
    assert project is not None
    files = [file.get("path", "") for file in project.findall("file")]
    listed = {
        (PORT / "ccs" / path).resolve() for path in files if path.endswith(".c") and path.startswith("..")
    }
    assert listed == {RING, *PORT.glob("*.c")}
    for folder in ("core", "mavlink", "app"):
        assert f"../../../{folder}" in files
        assert (PORT / "ccs" / f"../../../{folder}").resolve() == FIRMWARE / folder
    cmake = (PORT / "CMakeLists.txt").read_text()
    options = re.search(r"set\(own_options (.*?)\)", cmake.replace("${F28_MATH}", "strict"))
    assert options is not None
    for configuration in project.findall("configuration"):
        words = configuration.get("compilerBuildOptions", "").split()
        assert set(options[1].split()) <= set(words)
        assert ("--define=_FLASH" in words) == (configuration.get("name") == "FLASH")
        assert "--stack_size=1536" in configuration.get("linkerBuildOptions", "")
        assert "--define=F28_STACK_WORDS=1536U" in words


def pre_build_step() -> str:
    """Return the CCS project's step as a shell gets it: its path variable resolved."""
    root = ET.parse(PORT / "ccs" / "flightstack_f28377s.projectspec").getroot()
    steps = {configuration.get("preBuildStep", "") for configuration in root.iter("configuration")}
    assert len(steps) == 1
    (variable,) = [v for v in root.iter("pathVariable") if v.get("name") == "FLIGHTSTACK_FIRMWARE"]
    firmware = (PORT / "ccs" / variable.get("path", "")).resolve()
    assert firmware == FIRMWARE
    return steps.pop().replace("${FLIGHTSTACK_FIRMWARE}", str(firmware))


@pytest.mark.parametrize("name", ["python3", "python"])
def test_the_ccs_project_writes_the_hash_before_it_builds(name: str, tmp_path: Path) -> None:
    """By whichever name Python goes; every file is given the header, from the folder in which make runs."""
    tools, build = tmp_path / "bin", tmp_path / "FLASH"
    tools.mkdir()
    build.mkdir()
    (tools / name).symlink_to(sys.executable)
    done = subprocess.run(
        ["/bin/sh", "-c", pre_build_step()], cwd=build, env={"PATH": str(tools)}, check=False, timeout=60
    )
    assert done.returncode == 0
    assert hash_in(build / "source_hash.h") == source_hash()
    root = ET.parse(PORT / "ccs" / "flightstack_f28377s.projectspec").getroot()
    for configuration in root.iter("configuration"):
        words = configuration.get("compilerBuildOptions", "").split()
        assert "--preinclude=source_hash.h" in words
        assert "-I." in words


def test_a_header_that_is_right_is_left_alone_and_a_wrong_one_is_not(tmp_path: Path) -> None:
    """What includes it is compiled anew only when the sources changed."""
    script, header = PORT / "tools" / "write_source_hash.py", tmp_path / "source_hash.h"
    subprocess.run([sys.executable, script, header], check=True, timeout=60)
    os.utime(header, ns=(1, 1))
    subprocess.run([sys.executable, script, header], check=True, timeout=60)
    assert header.stat().st_mtime_ns == 1
    header.write_text("#define FS_SOURCE_HASH 0U\n")
    subprocess.run([sys.executable, script, header], check=True, timeout=60)
    assert hash_in(header) == source_hash()
