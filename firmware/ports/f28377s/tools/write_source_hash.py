"""Write the hash of the sources as a header: ``python write_source_hash.py source_hash.h``.

The CMake build and the CCS project give that header to the compiler by ``--preinclude``. ``gcs pil`` flies no board
whose hash is not that of its own sources. Needs Python 3.11 alone, nothing of the project installed.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[4] / "flightstack" / "firmware" / "sources.py"


def header() -> str:
    """Return the text of the header."""
    octets: bytes = runpy.run_path(str(SOURCES))["source_hash"]()
    return f"#define FS_SOURCE_HASH {', '.join(f'0x{octet:02X}U' for octet in octets)}\n"


def main(path: Path) -> None:
    """Write the header where it differs, lest all that include it be compiled anew; leave none if there is no hash."""
    try:
        text = header()
    except BaseException:
        path.unlink(missing_ok=True)  # an old one would belong to other sources
        raise
    if not path.is_file() or path.read_text(encoding="ascii") != text:
        path.write_text(text, encoding="ascii")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: write_source_hash.py source_hash.h")
    main(Path(sys.argv[1]))
