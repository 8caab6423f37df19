"""Every portable source through every compiler, their warnings as errors, and without the words it must not use."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.firmware.kept_builds import kept_text
from tests.firmware.static_support import (
    CPPCHECK,
    ESTIMATION,
    FIRMWARE,
    INCLUDES,
    LANGUAGE,
    OWN_DRIVERLIB,
    TARGETS,
    WARNINGS,
    Target,
    available,
    code_lines,
    portable_files,
    portable_sources,
    run,
    tools_files,
    without_comments,
)
from tests.support.tools import NIGHTLY

BY_DAY = ("gcc", "gcc, AVR")
"""Compilers of the estimator by day; all of them at night."""
POISON = ["gcc", "-std=c99", "-fsyntax-only", "-include", CPPCHECK / "poison.h", *INCLUDES]
SIZEOF_IS_OF_AN_OBJECT = {
    "fs_wire.c": ["memcpy(&bits, &value, sizeof bits);", "memcpy(&value, &bits, sizeof value);"],
}
"""The only two: memcpy counts chars as sizeof does, and both objects have 32 bits on every target."""
ALLOWED = {
    "fs_wire.c": ["-DPOISON_ALLOWS_MEMCPY"],
    "fs_sensing.c": ["-DPOISON_ALLOWS_MEMCPY", "-DPOISON_ALLOWS_UNION"],
}


@pytest.mark.parametrize("name", TARGETS)
def test_no_compiler_has_anything_to_say(name: str, tmp_path: Path) -> None:
    target = available(TARGETS[name])
    sources = [*portable_sources(), *(ESTIMATION if NIGHTLY or name in BY_DAY else [])]

    def built() -> str:
        done = run([*command_of(target), *sources], cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        return f"nothing in {len(sources)} files"

    label = "".join(c for c in name if c.isalnum())
    assert kept_text(f"{label}-{len(sources)}", target.command, tools_files(__file__), built).endswith(
        "files"
    )


def command_of(target: Target) -> list[str]:
    return [*target.command, *LANGUAGE, *WARNINGS, *target.flags, *INCLUDES, *target.output]


@pytest.mark.parametrize("name", TARGETS)
def test_a_compiler_looks_at_each_source_of_a_call(name: str, tmp_path: Path) -> None:
    (tmp_path / "1.c").write_text("extern int x;\n")
    (tmp_path / "2.c").write_text("extern int y;\n")
    (tmp_path / "3.c").write_text("extern int y;\nvoid f(void);\nvoid f(void) { int unused; }\n")
    done = run([*command_of(available(TARGETS[name])), *sorted(tmp_path.glob("*.c"))], cwd=tmp_path)
    assert "3.c:3" in done.stderr


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_the_boards_port_compiles_on_a_host_without_a_word(name: str, tmp_path: Path) -> None:
    """Against the tests' own driverlib. int has 32 bits here; cppcheck looks at it with 16."""
    ports = FIRMWARE / "ports"
    sources = [ports / "bare" / "fs_ring.c", *sorted((ports / "f28377s").glob("*.c"))]
    target = available(TARGETS[name])
    folders = [f"-I{ports / 'bare'}", f"-I{ports / 'f28377s'}", "-isystem", OWN_DRIVERLIB]
    done = run([*command_of(target), *folders, *sources], cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_no_source_uses_what_a_target_lacks() -> None:
    """The poison header ends the compilation at the first such word; gcc names the file."""
    available(TARGETS["gcc"])
    sources = [*portable_sources(), *ESTIMATION]
    others = [path for path in sources if path.name not in ALLOWED]
    apart = [[*POISON, *ALLOWED[path.name], path] for path in sources if path.name in ALLOWED]
    for command in ([*POISON, *others], *apart):
        done = run(command)
        assert (done.returncode, done.stderr) == (0, "")


FORBIDDEN = [
    "uint8_t octet;",
    "double x;",
    "void f(void *a, void *b) { memcpy(a, b, 4); }",
    "float root(float x) { return sqrtf(x); }",
    "long many;",
    "union both { float f; };",
    "void f(void) { again: goto again; }",
    "int size = sizeof(float);",
]


@pytest.mark.parametrize("code", FORBIDDEN)
def test_the_poison_header_kills(code: str, tmp_path: Path) -> None:
    available(TARGETS["gcc"])
    (tmp_path / "bad.c").write_text(code + "\n")
    done = run([*POISON, tmp_path / "bad.c"])
    assert done.returncode != 0
    assert "poisoned" in done.stderr


def test_sizeof_counts_no_octets() -> None:
    """A C28x counts 16 bits as one. The poison header sees code of one configuration, this every line."""
    found = {
        path.name: [line.strip() for _, line in code_lines(path) if re.search(r"\bsizeof\b", line)]
        for path in portable_files()
    }
    assert {name: lines for name, lines in found.items() if lines} == SIZEOF_IS_OF_AN_OBJECT


def test_the_boards_port_takes_no_sizes_either() -> None:
    port = sorted((FIRMWARE / "ports" / "f28377s").glob("*.[ch]"))
    assert port
    used = [(path.name, n, line.strip()) for path in port for n, line in code_lines(path) if "sizeof" in line]
    assert used == []


SHIFTED_OCTET = re.compile(r"<<\s*(?:1[6-9]|2\d|3[01])\b")


def test_shifts_by_a_word_are_of_a_longer_one() -> None:
    """``<< 16`` of what C calls an int: nothing on a host shows that it is too short on an AVR or a C28x."""
    lines = [line for path in portable_files() for _, line in code_lines(path) if SHIFTED_OCTET.search(line)]
    assert [line.strip() for line in lines] == ["return low | (high << 16);"]  # two uint32_t in fs_get_u32


PREPROCESSED_DOUBLE = re.compile(r"#ifdef FS_DOUBLE.*?(?:#else|#endif)", re.DOTALL)


def test_literals_have_the_type_of_the_loops() -> None:
    """A literal without suffix is a double: -Wdouble-promotion does not see one that is stored at once."""
    bare = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+[eE])(?:[eE][-+]?\d+)?(?![\w.])")
    for path in portable_files():
        text = PREPROCESSED_DOUBLE.sub("", without_comments(path.read_text()))
        text = re.sub(r"FS_LIT\([^()]*\)", "", text)
        text = re.sub(r"#if defined\(FS_DOUBLE\).*", "", text)
        assert bare.findall(text) == [], path.name
