"""The metadata file against the rules of MAVLink's parameter.schema.json, and the generated page."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

from flightstack.params.metadata import parameter_metadata, parameters_json
from flightstack.params.spec import LARGEST_NAME, ParamSpec
from tools.generate_params import all_specs

ROOT = Path(__file__).resolve().parents[2]
# the rules of parameter.schema.json (github.com/mavlink/mavlink, component_metadata), version 3
TYPES = {
    "name": str, "type": str, "shortDesc": str, "longDesc": str, "units": str, "default": (int, float),
    "decimalPlaces": int, "min": (int, float), "max": (int, float), "increment": (int, float),
    "rebootRequired": bool, "group": str, "category": str, "volatile": bool, "values": list, "bitmask": list,
    "readOnly": bool,
}  # fmt: skip
KINDS = ("Uint8", "Int8", "Uint16", "Int16", "Uint32", "Int32", "Float")


def test_the_file_keeps_the_schema() -> None:
    content = json.loads(parameters_json(all_specs()))
    assert set(content) == {"version", "parameters"}
    assert content["version"] == 3
    for entry in content["parameters"]:
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", entry["name"])
        assert entry["type"] in KINDS
        assert entry.get("decimalPlaces", 0) >= 0
        for key, value in entry.items():
            assert isinstance(value, TYPES[key]), (entry["name"], key)
        for choice in entry.get("values", []):
            assert set(choice) == {"value", "description"}


def test_metadata_matches_declarations() -> None:
    spec = ParamSpec("FS_MODE", 0, 0, 5, "", "What to do", True, "System", 0, ((0, "None"), (5, "End")), True)
    assert parameter_metadata([spec])["parameters"] == [
        {
            "name": "FS_MODE",
            "type": "Int32",
            "default": 0,
            "min": 0,
            "max": 5,
            "units": "",
            "shortDesc": "What to do",
            "longDesc": "What to do. Takes effect at the next start.",
            "decimalPlaces": 0,
            "group": "System",
            "category": "Standard",
            "values": [{"value": 0, "description": "None"}, {"value": 5, "description": "End"}],
            "rebootRequired": True,
        }
    ]


def test_the_same_declarations_give_the_same_text() -> None:
    specs = all_specs()
    assert parameters_json(specs) == parameters_json(reversed(specs))


def test_every_declaration_is_sound() -> None:
    for spec in all_specs():
        assert re.fullmatch(rf"[A-Z][A-Z0-9_]{{1,{LARGEST_NAME - 1}}}", spec.name), spec
        assert spec.accepted(spec.default) == spec.default, spec
        assert spec.low < spec.high, spec
        assert spec.help[0].isupper() or spec.help[0] == "c", spec  # c1 … c6 of the paper
        assert not spec.help.endswith("."), spec
        assert spec.group, spec
        assert spec.group != "Miscellaneous", spec


def test_the_page_is_fresh() -> None:
    command = [sys.executable, "-m", "tools.generate_params", "--check"]
    assert subprocess.run(command, cwd=ROOT, check=False).returncode == 0
