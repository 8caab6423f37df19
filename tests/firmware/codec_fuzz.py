"""Coverage-guided fuzz of the C parser and codec: ``python -m tests.firmware.codec_fuzz SECONDS``. Needs clang.

What was found grows in build/fuzz-parser/corpus; an input that breaks a promise is written beside it.
"""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

from tests.firmware.codec_support import (
    HARNESS,
    ROOT,
    SOURCES,
    any_frame,
    compile_c,
    compiler,
    damaged,
    sealed,
    stream,
)

FLAGS = ["-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all", "-g", "-O1", "-std=c99"]
LARGEST_INPUT = 900
"""Octets: three frames of the largest size, so that one can hide in, and behind, another."""


def fuzzer(folder: Path) -> Path:
    """Build the fuzzer and a corpus of frames, without which no random input would ever have a right checksum."""
    corpus, rng = folder / "corpus", random.Random(3)
    corpus.mkdir(parents=True, exist_ok=True)
    for number in range(150):
        parts = [
            any_frame(rng),
            damaged(rng, any_frame(rng)),
            sealed(54_321, any_frame(rng)[:250]),
            stream(number, 3),
        ]
        (corpus / f"seed-{number}").write_bytes(b"".join(rng.sample(parts, rng.randint(1, 4))))
    sources = [*SOURCES, HARNESS / "codec_shim.c", HARNESS / "fuzz_parser.c"]
    return compile_c(folder / "fuzz_parser", sources, *FLAGS, cc=compiler("clang"))


def main() -> int:
    """Fuzz for the seconds that the first argument says."""
    folder = ROOT / "build" / "fuzz-parser"
    program = fuzzer(folder)
    limits = [f"-max_total_time={int(sys.argv[1])}", f"-max_len={LARGEST_INPUT}", "-print_final_stats=1"]
    return subprocess.run([str(program), *limits, "corpus"], check=False, cwd=folder).returncode


if __name__ == "__main__":
    sys.exit(main())
