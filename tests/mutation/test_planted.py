"""Faults of the kinds that people make, planted into core and codec: the tests of everyday catch each of them."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.firmware import (
    codec_support,
    core_support,
    test_codec_builds,
    test_codec_messages,
    test_codec_parser,
    test_core_builds,
    test_core_loops,
    test_static_cppcheck,
)
from tests.mutation.mutants import mutants, one_more, one_ulp_more
from tests.parity import test_c_laws, test_c_mixer

ROOT = Path(__file__).resolve().parents[2]
PARAM_VALUE = 22
Plant = Callable[[str, str, str], Path]


@pytest.fixture
def plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Plant]:
    """Return a function that lets the tests compile sources with one passage written otherwise."""
    for tests in (test_c_laws, test_c_mixer):
        monkeypatch.setattr(tests, "COUNT", 20_000)
    _forget()

    def planted(file: str, right: str, wrong: str) -> Path:
        folder = tmp_path / Path(file).parent
        shutil.copytree(ROOT / "firmware" / Path(file).parent, folder)
        text = (tmp_path / file).read_text()
        assert text.count(right) == 1, "the source has changed: plant this fault anew"
        (tmp_path / file).write_text(text.replace(right, wrong))
        if folder.name == "core":
            monkeypatch.setattr(core_support, "CORE", folder)
        else:
            monkeypatch.setattr(codec_support, "CODEC", folder)
            for module in (codec_support, test_codec_builds):
                monkeypatch.setattr(module, "SOURCES", sorted(folder.glob("*.c")))
        return tmp_path / file

    yield planted
    monkeypatch.undo()
    _forget()


def _forget() -> None:
    """Drop what the tests keep of a build."""
    for module in (core_support, test_c_laws, test_c_mixer, test_core_builds, test_core_loops):
        for name, thing in vars(module).items():
            if isinstance(thing, functools._lru_cache_wrapper) and name != "flight":
                thing.cache_clear()


def caught(test: Callable[..., None], *arguments: object) -> bool:
    """Tell whether a test fails."""
    try:
        test(*arguments)
    except AssertionError:
        return True
    return False


def test_a_sign_in_the_mixer(plant: Plant) -> None:
    right = "lift[i] = base[i] + mixer->allocation[i][0]"
    plant("core/fs_mixer.c", right, right.replace(" + ", " - "))
    assert caught(test_c_mixer.test_mixer_in_double_has_pythons_bits, "cross")


def test_a_gain_that_is_off_by_its_last_bit(plant: Plant) -> None:
    gain = '{"POS_XY_P", FS_LIT(0.0), FS_LIT(1000.0), FS_LIT(8.75)'
    plant("core/fs_param_table.c", gain, gain.replace("8.75", one_ulp_more("8.75")))
    assert caught(test_core_builds.test_every_parameter_starts_at_its_default_and_takes_its_range, "float")


def test_a_constant_of_a_law_that_is_off_by_its_last_bit(plant: Plant) -> None:
    right = "const fs_real friction = FS_LIT(2.0) *"
    plant("core/fs_attitude_reference.c", right, right.replace("2.0", one_ulp_more("2.0")))
    assert caught(test_c_laws.test_attitude_reference_in_double_has_pythons_bits)


def test_gains_of_another_axis(plant: Plant) -> None:
    plant("core/fs_attitude_backstepping.c", "params->c3, params->c4", "params->c4, params->c3")
    assert caught(test_c_laws.test_attitude_laws_in_double_have_pythons_bits, test_c_laws.backstepping)


def test_an_integrator_that_winds_up(plant: Plant) -> None:
    plant("core/fs_attitude_pid.c", "error * saturation > FS_LIT(0.0)", "error * saturation < FS_LIT(0.0)")
    assert caught(test_c_laws.test_attitude_laws_in_double_have_pythons_bits, test_c_laws.pid)


def test_a_status_bit_of_another_axis(plant: Plant) -> None:
    right = "resolution->pitch, FS_STATUS_PITCH_SATURATED"
    plant("core/fs_mixer_limits.c", right, right.replace("PITCH", "YAW"))
    assert caught(test_core_loops.test_a_shaken_vehicle_is_answered_as_by_python, "four")


def test_a_short_way_that_is_allowed_by_thrust_alone(plant: Plant) -> None:
    """Of effectiveness times allocation the first row is looked at: nothing that flies today has another one wrong."""
    right = "for (row = 0U; row < 4U; row++) {"
    plant("core/fs_mixer_limits.c", right, right.replace("4U", "1U"))
    assert not caught(test_c_mixer.test_the_mixer_knows_which_short_ways_it_may_go, "cross", "double")
    assert caught(
        test_c_mixer.test_each_number_of_effectiveness_times_allocation_is_looked_at, "double", 1e-12
    )
    assert caught(test_c_mixer.test_what_allocation_does_beside_the_demand_is_told_as_achieved)


def test_swapped_fields_of_a_message(plant: Plant, tmp_path: Path) -> None:
    count, index = (
        "m->param_count = fs_get_u16(payload, length, {});",
        "m->param_index = fs_get_u16(payload, length, {});",
    )
    right, wrong = (f"{count}\n    {index}".format(*offsets) for offsets in (("4U", "6U"), ("6U", "4U")))
    plant("mavlink/fs_messages.c", right, wrong)
    codec = codec_support.load(tmp_path)
    assert caught(test_codec_messages.test_decoded_values_are_those_on_the_wire, codec, PARAM_VALUE)


def test_an_octet_whose_high_bits_are_believed(plant: Plant, tmp_path: Path) -> None:
    """Right wherever an octet was written by ourselves; a C28x may hold rubbish above."""
    plant("mavlink/fs_wire.c", "octet = (fs_octet)(payload[offset] & 0xFFU);", "octet = payload[offset];")
    codec = codec_support.load(tmp_path)
    assert not caught(test_codec_parser.test_pymavlink_agrees_on_a_clean_line, codec)
    assert caught(test_codec_messages.test_decoded_values_are_those_on_the_wire, codec, PARAM_VALUE)


def test_a_parser_that_does_not_look_inside_what_was_bad(plant: Plant, tmp_path: Path) -> None:
    plant(
        "mavlink/fs_parser.c",
        "            parser->skipped++;\n            at++;",
        "            at = parser->count;",
    )
    codec = codec_support.load(tmp_path)
    assert caught(test_codec_parser.test_a_lost_octet_costs_no_other_frame, codec)


def test_a_length_that_was_never_written(plant: Plant, tmp_path: Path) -> None:
    """What lay on the stack is right by chance, or not: MemorySanitizer does not depend on it."""
    right = "candidate->size = FS_HEADER_V1;"
    plant("mavlink/fs_parser.c", right, ";")
    assert caught(test_codec_builds.test_nothing_is_decided_by_memory_that_was_never_written, tmp_path)


SHIFTED = (
    "uint32_t high = fs_get_u16(payload, length, (uint16_t)(offset + 2U));\n\n    return low | (high << 16);"
)


def test_an_overflow_that_only_an_int_of_16_bits_has(plant: Plant, tmp_path: Path) -> None:
    """The host's compilers and what they compute are content; the AVR is not."""
    wrong = SHIFTED.replace("uint32_t", "uint16_t").replace("(high << 16)", "(uint32_t)(high * 256 * 256)")
    plant("mavlink/fs_wire.c", SHIFTED, wrong)
    assert not caught(test_codec_builds.test_compilers_agree, "gcc", "-O2", tmp_path)
    assert caught(test_codec_builds.test_an_avr_agrees_where_an_int_has_16_bits, tmp_path)


def test_a_shift_too_far_for_16_bits(plant: Plant, tmp_path: Path) -> None:
    """Again a host sees nothing; cppcheck does, which knows what a C28x is."""
    wrong = SHIFTED.replace("uint32_t", "uint16_t").replace("(high << 16)", "(uint32_t)(high << 16)")
    path = plant("mavlink/fs_wire.c", SHIFTED, wrong)
    assert not caught(test_codec_builds.test_compilers_agree, "gcc", "-O2", tmp_path)
    assert "shiftTooManyBits" in [finding.rule for finding in test_static_cppcheck.cppcheck(tmp_path, path)]


# ------------------------------------------------------------------ the mutator itself

EXAMPLE = """#include <a-b.h>
/* x + y */
#define LEAST FS_LIT(0.5)
#ifdef FS_DOUBLE
#define SHARE 3.0
#else
#define SHARE 4.0F
#endif
static fs_real f(const fs_real *a, uint16_t n)
{
    fs_real sum = -a[0];
    sum += a->x * 2U;
    return n < 3U ? sum : LEAST;
}
"""


def test_mutants_of_an_example() -> None:
    made = {(m.line, m.before.strip(), m.after.strip()) for m in mutants("example.c", EXAMPLE)}
    assert made == {
        (3, "0.5", "0.50000005960464478"),
        (7, "4.0F", "4.0000004768371582F"),
        (11, "-", ""),
        (11, "0", "1"),
        (12, "sum += a->x * 2U;", ";"),
        (12, "+=", "-="),
        (12, "x", "y"),
        (12, "*", "/"),
        (12, "2U", "3U"),
        (13, "<", "<="),
        (13, "<", ">"),
        (13, "3U", "4U"),
    }


def test_a_mutant_differs_in_one_place_and_belongs_to_one_text() -> None:
    for mutant in mutants("example.c", EXAMPLE):
        changed = mutant.applied(EXAMPLE)
        end = len(EXAMPLE) - mutant.start - len(mutant.before)
        assert changed[: mutant.start] == EXAMPLE[: mutant.start]
        assert changed[len(changed) - end :] == EXAMPLE[mutant.start + len(mutant.before) :]
        assert changed != EXAMPLE
        with pytest.raises(ValueError, match="not as it was"):
            mutant.applied("?" * len(EXAMPLE))


def test_constants_move_by_the_least_step() -> None:
    assert float(one_ulp_more("8.75")) == 8.75 + 2.0**-20
    assert float(one_ulp_more("0.0")) == 1.0
    assert float(one_ulp_more("3.4028234663852886e38")) < 3.4028234663852886e38
    assert [one_more(text) for text in ("0U", "0xFFU", "65535UL")] == ["1U", "0x100U", "65536UL"]
