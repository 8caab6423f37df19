"""Write flightstack/mavlink/dialect_generated.py from flightstack.xml, read with pymavlink's own parser.

Only our enumeration values and the layouts of our messages are generated; those of common.xml come with pymavlink.
``--check`` fails when the file is stale.
"""

from __future__ import annotations

import sys
from typing import Any

from pymavlink.generator import mavparse

from tools.generated import ROOT, write_or_check

FOLDER = ROOT / "flightstack" / "mavlink"
HEADER = '''"""Generated from flightstack.xml by tools/generate_dialect.py: do not edit."""

from flightstack.mavlink.layout import Field, Layout

'''
FORMATS = {
    "uint64_t": "Q",
    "uint32_t": "I",
    "uint16_t": "H",
    "uint8_t": "B",
    "int64_t": "q",
    "int32_t": "i",
    "int16_t": "h",
    "int8_t": "b",
    "char": "s",
    "double": "d",
    "float": "f",
}


def layout_source(message: Any) -> str:
    """Return the source text of one message's layout; fields in wire order, as the checksum demands.

    Extension fields come last on the wire, in their declared order, and count for no checksum.
    """
    names = [field.name for field in message.fields]
    first_extension = len(names) if message.extensions_start is None else message.extensions_start
    rows = [
        f'            Field("{field.name}", "{FORMATS[field.type]}", {max(1, field.array_length)}, '
        f'{bool(field.array_length)}, "{field.type}", "{field.units.strip("[]")}", {names.index(field.name)}'
        f"{', True' if names.index(field.name) >= first_extension else ''}),"
        for field in message.ordered_fields
    ]
    return "\n".join(
        [
            "    Layout(",
            f"        {message.id},",
            f'        "{message.name}",',
            f"        {message.crc_extra},",
            "        (",
            *rows,
            "        ),",
            "    ),",
        ]
    )


def generated() -> str:
    """Return the text of the generated module."""
    xml = mavparse.MAVXML(str(FOLDER / "flightstack.xml"), mavparse.PROTOCOL_2_0)
    entries = [entry for enum in xml.enum for entry in enum.entry if not entry.end_marker]
    values = "".join(f'    "{entry.name}": {entry.value},\n' for entry in entries)
    layouts = "\n".join(layout_source(message) for message in xml.message)
    return f"{HEADER}ENTRIES = {{\n{values}}}\n\nLAYOUTS = (\n{layouts}\n)\n"


if __name__ == "__main__":
    sys.exit(write_or_check({FOLDER / "dialect_generated.py": generated()}))
