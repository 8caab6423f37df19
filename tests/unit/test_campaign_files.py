"""Campaign files: distributions, inputs, and the plan of the flights."""

from __future__ import annotations

import io
from collections.abc import Generator, Mapping
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from flightstack.core.errors import ConfigError
from flightstack.params.vehicle import load_vehicle, load_vehicle_with
from flightstack.testing.scenario import Scenario
from gcs_cli.campaign.definition import Campaign, load_campaign
from gcs_cli.campaign.display import make_display
from gcs_cli.campaign.distributions import Distribution, Value, read_distribution
from gcs_cli.campaign.flyer import Flyer, check_flights
from gcs_cli.campaign.journal import open_journal, record_of
from gcs_cli.campaign.options import CampaignOptions
from gcs_cli.campaign.plan import flight_seed, plan_flights
from gcs_cli.scenarios.pool import Cases, Message, Started
from gcs_cli.scenarios.result import Wanted

HOP = Path(__file__).resolve().parents[2] / "missions" / "hop.plan"
SCENARIO = """\
plan = "hop"
vehicle = "x_quad"
state = "truth"
[wind]
gust_m_s = 0.5
[[event]]
at_s = 2
fault = "rotor:2:weak={weak}"
[expect]
max_error_m = 0.6
"""
VARY = """\
[vary]
wind.gust_m_s = { uniform = [0, 2] }
"wind.mean_m_s[1]" = { normal = [0, 2], low = -3, high = 3 }
"event[0].at_s" = { uniform = [1.0, 3.0] }
simulated.body.mass_kg = { uniform = [1.2, 1.8] }
params.MPC_XY_CRUISE = { log_uniform = [0.5, 2] }
weak = { choice = [0.8, 0.9, 1.0] }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def campaign(folder: Path, head: str = "flights = 8", vary: str = VARY, scenario: str = SCENARIO) -> Campaign:
    path = folder / "c.toml"
    path.write_text(f"{scenario}\n[campaign]\n{head}\n{vary}", encoding="utf-8")
    return load_campaign(path)


def test_inputs_reach_every_kind_of_key(folder: Path) -> None:
    found = campaign(folder)
    inputs = {
        "wind.gust_m_s": 1.5, "wind.mean_m_s[1]": -2.0, "event[0].at_s": 2.5, "simulated.body.mass_kg": 1.7,
        "params.MPC_XY_CRUISE": 1.25, "weak": 0.9,
    }  # fmt: skip
    flown = found.scenario(inputs)
    assert (flown.wind.gust_m_s, flown.wind.mean_m_s) == (1.5, (0.0, -2.0))
    assert (flown.event[0].at_s, flown.event[0].fault) == (2.5, "rotor:2:weak=0.9")
    assert (flown.simulated, flown.params) == ({"body.mass_kg": 1.7}, {"MPC_XY_CRUISE": 1.25})
    assert found.scenario({}).wind.gust_m_s == 0.5  # the content of the file is not changed


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("force_n[2]", -1.0, {"force_n": (0.0, 0.0, -1.0)}),
        ("torque_n_m[0]", 0.1, {"torque_n_m": (0.1, 0.0, 0.0)}),
        ("boat_m_s[1]", 2.0, {"boat_m_s": (0.0, 2.0)}),
    ],
)
def test_part_of_a_list_that_the_file_does_not_have_varies(
    folder: Path, name: str, value: float, found: dict[str, tuple[float, ...]]
) -> None:
    vary = f'[vary]\n"{name}" = {{ uniform = [0, 1] }}\n'
    flown = campaign(folder, vary=vary, scenario='plan = "hop"\n[expect]\n').scenario({name: value})
    assert {key: getattr(flown, key) for key in found} == found


def test_simulated_mass_leaves_rotors_and_flight_stack_as_they_are(folder: Path) -> None:
    flown = campaign(folder).scenario({"simulated.body.mass_kg": 1.8}).setup(1)
    file = load_vehicle("x_quad")
    simulated, _ = flown.plant_options(file)
    assert (file.mass_kg, simulated.mass_kg) == (1.5, 1.8)
    assert simulated.rotors == file.rotors
    ratio = load_vehicle_with("x_quad", {"body.mass_kg": 1.8, "rotor_type.thrust_to_weight": 2.0})
    assert ratio.max_thrust_n == pytest.approx(2.0 * file.weight_n, rel=1e-12)


@pytest.mark.parametrize("method", ["monte-carlo", "latin-hypercube", "sobol"])
def test_plan_follows_from_the_seed_alone(folder: Path, method: str) -> None:
    head = f"method = '{method}'\nflights = 64\n"
    first = plan_flights(campaign(folder, head))
    assert first == plan_flights(campaign(folder, head))
    assert [flight.number for flight in first] == list(range(1, 65))
    assert len({flight.seed for flight in first}) == 64
    other = plan_flights(campaign(folder, head + "seed = 2"))
    assert not {flight.inputs["wind.gust_m_s"] for flight in first} & {
        flight.inputs["wind.gust_m_s"] for flight in other
    }
    for flight in first:
        assert 0.0 <= flight.inputs["wind.gust_m_s"] <= 2.0
        assert -3.0 <= flight.inputs["wind.mean_m_s[1]"] <= 3.0


@pytest.mark.parametrize("method", ["latin-hypercube", "sobol"])
def test_stratified_methods_have_one_flight_in_each_stratum(folder: Path, method: str) -> None:
    flights = plan_flights(campaign(folder, f"method = '{method}'\nflights = 16"))
    strata = sorted(int(flight.inputs["wind.gust_m_s"] / 2.0 * 16) for flight in flights)
    assert strata == list(range(16))


def test_grid_flies_every_combination(folder: Path) -> None:
    vary = "[vary]\nwind.gust_m_s = {uniform = [0, 2], steps = 3}\nweak = {choice = [0.8, 1.0]}\n"
    flights = plan_flights(campaign(folder, "method = 'grid'\nflights = 2", vary))
    assert [tuple(flight.inputs.values()) for flight in flights] == [
        (gust, weak) for gust in (0.0, 1.0, 2.0) for weak in (0.8, 1.0) for _ in range(2)
    ]
    assert len({flight.seed for flight in flights}) == 12


def test_a_named_scenario_flies_as_one_in_the_file(folder: Path) -> None:
    (folder / "s.toml").write_text(f"seed = 9\nrepeat = 4\n{SCENARIO.replace('{weak}', '0.9')}")
    (folder / "c.toml").write_text(
        "[campaign]\nscenario = 's.toml'\n[vary]\n'event[0].at_s' = {uniform = [1, 3]}"
    )
    found = load_campaign(folder / "c.toml")
    assert len(plan_flights(found)) == 100
    assert found.scenario({"event[0].at_s": 1.5}).event[0].at_s == 1.5


@pytest.mark.parametrize(
    ("kind", "share", "value"),
    [
        ({"uniform": [2, 4]}, 0.25, 2.5),
        ({"log_uniform": [1, 100]}, 0.5, 10.0),
        ({"normal": [3, 2]}, 0.5, 3.0),
        ({"normal": [0, 1]}, 0.8413447460685429, 1.0),
        ({"normal": [0, 1], "low": 0}, 0.0, 0.0),
        ({"normal": [0, 1], "low": -1, "high": 1}, 1.0, 1.0),
    ],
)
def test_distribution_and_its_inverse(kind: dict[str, object], share: float, value: float) -> None:
    found = read_distribution(kind)
    assert found.at(share) == pytest.approx(value, abs=1e-12)
    assert found.share_of(value) == pytest.approx(share, abs=1e-12)


def test_normal_distribution_has_its_mean_and_deviation() -> None:
    found = Distribution("normal", (3.0, 2.0))
    values = np.array([found.at((index + 0.5) / 20_000) for index in range(20_000)])
    assert values.mean() == pytest.approx(3.0, abs=1e-9)
    assert values.std() == pytest.approx(2.0, abs=2e-3)  # 5e-4: the ends are cut
    assert np.isfinite([found.at(0.0), found.at(1.0)]).all()


@pytest.mark.parametrize(
    ("head", "vary", "sentence"),
    [
        (
            "flight = 3",
            VARY,
            "campaign.flight: is not a known key; known are method, flights, seed, scenario",
        ),
        (
            "method = 'random'",
            VARY,
            "campaign.method: 'random' is not one of monte-carlo, grid, latin-hypercube, sobol",
        ),
        (
            "method = 'sobol'\nflights = 100",
            VARY,
            "campaign.flights: 100 is no power of 2, as sobol needs it: give 64 or 128",
        ),
        ("", "", "vary: is missing: name an input and its distribution"),
        (
            "",
            "[vary]\nweak = {uniform = [2, 1]}",
            "vary.weak: uniform = [2, 1]: the first number must be below the second",
        ),
        (
            "",
            "[vary]\nweak = {gauss = [2, 1]}",
            "vary.weak: needs one distribution of uniform, normal, log_uniform, choice",
        ),
        (
            "",
            "[vary]\nweak = {normal = [2, 0]}",
            "vary.weak: normal = [2, 0]: the standard deviation must be above 0",
        ),
        (
            "",
            "[vary]\nweak = {normal = [0, 1], low = 9, high = 10}",
            "vary.weak: no number of normal = [0, 1] lies between 9 and 10",
        ),
        (
            "",
            "[vary]\nweak = {log_uniform = [0, 1]}",
            "vary.weak: log_uniform = [0, 1]: both numbers must be above 0",
        ),
        (
            "",
            "[vary]\nweak = {choice = [1, 'a']}",
            "vary.weak: choice must be numbers only, texts only or flags only",
        ),
        ("", "[vary]\nweak = 3", "vary.weak: needs one distribution of"),
        ("", "[vary]\nweak = {uniform = [0, nan]}", "vary.weak: uniform must be a list of 2 finite numbers"),
        (
            "",
            "[vary]\nstrong = {uniform = [0, 1]}",
            "vary.strong: is neither a key of the scenario nor in one of its texts as {strong}",
        ),
        (
            "",
            "[vary]\nexpect.max_error_m = {uniform = [0, 1]}",
            "vary.expect.max_error_m: cannot be varied: what is expected is the same in each flight",
        ),
        (
            "",
            "[vary]\nseed = {uniform = [0, 1]}",
            "vary.seed: cannot be varied: each flight has a seed of its own",
        ),
        (
            "method = 'grid'",
            "[vary]\nweak = {uniform = [0, 1]}",
            "vary.weak.steps: is missing: a grid needs the number of values",
        ),
        ("", "[vary]\nweak = {uniform = [0, 1], steps = 3}", "vary.weak.steps: is for a grid"),
        (
            "scenario = 's.toml'",
            VARY,
            "campaign.scenario: names a scenario, so that this file has no other keys, such as plan",
        ),
    ],
)
def test_a_wrong_file_is_one_sentence(folder: Path, head: str, vary: str, sentence: str) -> None:
    with pytest.raises(ConfigError) as refused:
        campaign(folder, head, vary)
    assert str(refused.value).startswith(f"{folder / 'c.toml'}: {sentence}")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("seed = 'x'", "seed: 'x' is not a whole number"),
        ("seed = -5", "seed: -5 is outside the allowed range"),
        ("repeat = 0", "repeat: 0 is outside the allowed range"),
    ],
)
def test_keys_of_the_scenario_without_effect_are_checked(folder: Path, line: str, sentence: str) -> None:
    with pytest.raises(ConfigError) as refused:
        campaign(folder, scenario=f"{line}\n{SCENARIO}")
    assert str(refused.value).startswith(f"{folder / 'c.toml'}: {sentence}")


@pytest.mark.parametrize(
    ("vary", "sentence"),
    [
        ("'event[3].at_s' = {uniform = [1, 2]}", "vary.event[3].at_s: the file has no item [3] there"),
        ("wind.gust_m_s = {uniform = [0, 80]}", "wind.gust_m_s: 7"),
        ("params.NONE = {uniform = [0, 80]}", "params: NONE: the vehicle has no such parameter"),
        ("simulated.body.mass = {uniform = [1, 2]}", "simulated: "),
        ("simulated.body.mass_kg = {uniform = [1, 5]}", "simulated: "),
        ("weak = {uniform = [0, 9]}", "event[0].fault: "),
        ("plan = {choice = ['none']}", "{folder}/none: "),
    ],
)
def test_inputs_out_of_range_are_refused_before_a_flight(folder: Path, vary: str, sentence: str) -> None:
    scenario = SCENARIO if vary.startswith("weak") else SCENARIO.replace("{weak}", "0.9")
    found = campaign(folder, "flights = 50", f"[vary]\n{vary}", scenario)
    flights = plan_flights(found)
    with pytest.raises(ConfigError) as refused:
        check_flights(found, flights)
    assert str(refused.value).startswith(f"{folder / 'c.toml'}: vary, flight ")
    assert f"({next(iter(found.vary))} " in str(refused.value)
    assert str(refused.value).count("c.toml") == 1
    assert sentence.replace("{folder}", str(folder)) in str(refused.value)


def test_an_error_of_all_flights_names_no_flight(folder: Path) -> None:
    scenario = SCENARIO.replace("{weak}", "0.9").replace('"hop"', '"hopp"')
    found = campaign(folder, vary="[vary]\nwind.gust_m_s = { uniform = [0, 2] }\n", scenario=scenario)
    with pytest.raises(ConfigError, match=r"^[^ ]*c.toml: [^ ]*hopp: cannot be read"):
        check_flights(found, plan_flights(found))


def test_whole_numbers_of_a_grid_are_checked_between_its_ends(folder: Path) -> None:
    scenario = SCENARIO.replace("{weak}", "0.9").replace("[wind]", "[[client]]\nname = 'a'\n[wind]")
    vary = "[vary]\n'client[0].system_id' = { uniform = [1, 4], steps = 3 }"
    found = campaign(folder, "method = 'grid'", vary, scenario)
    with pytest.raises(ConfigError, match=r"client\[0\].system_id: 2.5 is not a whole number"):
        check_flights(found, plan_flights(found))


@pytest.mark.parametrize(
    ("plan", "vary"),
    [
        ("method = 'grid'", "inner_hz = {choice = [500, 1000]}\nouter_hz = {choice = [100, 200, 250]}"),
        ("flights = 60", "inner_hz = {choice = [500, 1000]}\nouter_hz = {choice = [100, 200, 250]}"),
        ("method = 'grid'", "outer_hz = {uniform = [100, 500], steps = 5}"),
        ("flights = 60", "inner_hz = {uniform = [200, 1000]}"),
    ],
)
def test_rates_are_checked_together(folder: Path, plan: str, vary: str) -> None:
    found = campaign(folder, plan, f"[vary]\n{vary}", SCENARIO.replace("{weak}", "0.9"))
    with pytest.raises(ConfigError, match=r"does not divide|whole number of microseconds"):
        check_flights(found, plan_flights(found))


def test_check_reads_few_of_many_flights(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = campaign(folder, "flights = 2000")
    read, made = [], Campaign.scenario

    def scenario(self: Campaign, inputs: Mapping[str, Value]) -> Scenario:
        read.append(inputs)
        return made(self, inputs)

    monkeypatch.setattr(Campaign, "scenario", scenario)
    check_flights(found, plan_flights(found))
    assert len(read) <= 1 + 5 * 2 + 3  # the first, both ends of five ranges, three choices


def test_each_case_is_made_when_it_is_flown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = campaign(folder, "flights = 100")
    flights, read, made = plan_flights(found), [], Campaign.scenario

    def scenario(self: Campaign, inputs: Mapping[str, Value]) -> Scenario:
        read.append(inputs)
        return made(self, inputs)

    class Pool:
        def fly(self, cases: Cases, wanted: Wanted) -> Generator[Message, None, None]:
            assert len(cases) == 100
            yield Started(7)
            assert cases[7].seed == flights[7].seed

    monkeypatch.setattr(Campaign, "scenario", scenario)
    options = CampaignOptions(folder / "c.toml")
    display = make_display(Console(file=io.StringIO()), 100, ())
    with open_journal(folder, record_of("plan", found.path, {}, flights)) as journal:
        Flyer(Pool(), found, journal, display, options).fly(flights)
    assert read == [flights[7].inputs]


def test_each_choice_is_checked_before_a_flight(folder: Path) -> None:
    found = campaign(
        folder,
        "flights = 12",
        "[vary]\ngains = { choice = ['backstepping_poles', 'nope', 'paper'] }",
        SCENARIO.replace("{weak}", "0.9"),
    )
    with pytest.raises(ConfigError, match="nope"):
        check_flights(found, plan_flights(found))


def test_file_that_a_number_names_is_part_of_the_record(folder: Path) -> None:
    for number in (1, 2):
        (folder / f"p{number}.plan").write_bytes(HOP.read_bytes())
    found = campaign(
        folder,
        "flights = 8",
        "[vary]\nn = { choice = [1, 2] }",
        'plan = "p{n}.plan"\n[expect]\nmax_error_m = 1',
    )
    flights = plan_flights(found)
    assert sorted(found.files(each.inputs for each in flights)) == ["c.toml", "p1.plan", "p2.plan"]


def test_a_flight_has_the_same_seed_in_a_longer_campaign() -> None:
    assert [flight_seed(1, number) for number in (1, 2)] != [flight_seed(2, number) for number in (1, 2)]
    assert flight_seed(1, 2) == 1596810411


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("wind.gust_m_s", 0.5),
        ("wind.mean_m_s[1]", 0.0),
        ("event[0].at_s", 2.0),
        ("simulated.body.mass_kg", 1.5),
    ],
)
def test_nominal_value_of_an_input(folder: Path, name: str, value: float) -> None:
    assert campaign(folder).nominal(name) == value
