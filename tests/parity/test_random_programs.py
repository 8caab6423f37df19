"""Random programs of the generator's subset have Python's bits in generated C."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings

from flightstack.firmware.generator.call_c import CFunction, Vectors, differences
from flightstack.firmware.generator.unit import Program
from tests.parity.random_programs import HEAD, function, programs
from tests.support.generated_c import compile_program, in_python
from tests.support.tools import NIGHTLY

PROGRAMS = 500 if NIGHTLY else 50


def drawn() -> list[list[str]]:
    """Return the bodies of the programs, the same in every run."""
    bodies: list[list[str]] = []

    @settings(
        max_examples=2 * PROGRAMS,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(programs())
    def collect(body: list[str]) -> None:
        if body not in bodies:
            bodies.append(body)

    collect()
    return bodies[-PROGRAMS:]


def test_random_programs_have_pythons_bits(tmp_path: Path) -> None:
    path, bodies = tmp_path / "random_laws.py", drawn()
    path.write_text(HEAD + "".join(function(number, body) for number, body in enumerate(bodies)))
    spec = importlib.util.spec_from_file_location("random_laws", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["random_laws"] = module
    spec.loader.exec_module(module)
    program = Program()
    laws = [getattr(module, f"law_{number}") for number in range(len(bodies))]
    functions = [program.add(law) for law in laws]
    library, vectors, known = compile_program(program, tmp_path / "c"), Vectors(1), {}
    assert len(laws) >= PROGRAMS
    for law, made in zip(laws, functions, strict=True):
        samples = [vectors.arguments(made) for _ in range(12)]
        found = differences(CFunction(library, made), in_python(law, known), samples)
        assert not found, (made.place, found[0])
