"""pytest plugin: the fixtures ``sitl`` and ``sitl_server``, reports of failed flights, and scenario files as tests.

Every run of pytest in the environment loads this module: it imports nothing heavy before a fixture is used.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Generator, Iterator, Sequence
from opcode import opmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from flightstack.testing.owners import Owners

if TYPE_CHECKING:
    from flightstack.testing.artifacts import Artifacts, Evidence
    from flightstack.testing.pytest_items import ScenarioFile
    from flightstack.testing.sitl import Sitl, SitlServer

_OWNERS = pytest.StashKey[Owners]()
_ARTIFACTS = pytest.StashKey["Artifacts"]()
_SITL = pytest.StashKey["Sitl"]()
_SERVERS = pytest.StashKey["SitlServer"]()
_SECTION = "flightstack"
"""Title of the section in the report of a failed test."""
_TESTING = "flightstack.testing."
_OURS = frozenset({"flightstack", "sim_bridge", "gcs_cli"})
_BELOW_TESTS = _OURS | sys.stdlib_module_names
_REFUSALS = frozenset(
    {
        "ConfigError",
        "RefusedError",
        "ConditionTimeoutError",
        "PropertyViolationError",
        "ServerRefusalError",
        "UsageProblemError",
    }
)
"""Errors of this project that say what a test asked for in vain, by name: their modules are heavy."""
_ARGUMENTS = frozenset(_TESTING + name for name in ("link", "network", "setup", "sitl", "world"))
"""Modules that raise TypeError and ValueError for arguments."""
"""Packages whose frames are below those of a test."""


# ---------------------------------------------------------------------- fixtures


@pytest.fixture(scope="session")
def sitl(request: pytest.FixtureRequest) -> Sitl:
    """Vehicles in simulated worlds, in this process and in simulated time.

    ``sitl(vehicle="x_quad", wind=(5.0, 0.0), seed=3)`` returns a World, which is closed after the test or with the
    fixture that made it. ``sitl.fly("square.plan", ...)`` flies a plan in a world of its own and returns the Flight.
    """
    from flightstack.testing.sitl import Sitl

    config = request.config
    config.stash[_SITL] = Sitl(config.stash[_OWNERS], config.rootpath)
    return config.stash[_SITL]


@pytest.fixture(scope="session")
def sitl_server(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[SitlServer]:
    """Vehicles as processes with real sockets, for MAVSDK, pymavlink and other clients.

    ``sitl_server(vehicle="x_quad", speed=5.0)`` returns a Server with free ports, which is stopped after the test or
    with the fixture that started it.
    """
    from flightstack.testing.sitl import SitlServer

    config = request.config
    servers = SitlServer(config.stash[_OWNERS], lambda: tmp_path_factory.mktemp("sitl-server"))
    config.stash[_SERVERS] = servers
    yield servers
    servers.stop_all()


# ---------------------------------------------------------------------- configuration


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option of the plugin."""
    parser.getgroup("flightstack").addoption(
        "--sitl-artifacts",
        metavar="DIR",
        help="Directory for logs and reports of failed flights, a folder for each test. "
        "[default: flightstack in pytest's cache]",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Begin to track the owners of worlds."""
    config.stash[_OWNERS] = Owners()
    given = config.getoption("--sitl-artifacts", None)
    if given is not None:  # workers of pytest-xdist get an absolute path
        config.option.sitl_artifacts = str(config.invocation_params.dir / given)


def _artifacts(config: pytest.Config) -> Artifacts:
    if _ARTIFACTS not in config.stash:
        from flightstack.testing.artifacts import Artifacts

        given = config.getoption("--sitl-artifacts", None)
        if given is not None:
            folder = Path(given)
        elif hasattr(config, "cache"):
            folder = config.cache.mkdir("flightstack")
        else:
            folder = Path(tempfile.mkdtemp(prefix="flightstack-"))
        config.stash[_ARTIFACTS] = Artifacts(folder)
    return config.stash[_ARTIFACTS]


# ---------------------------------------------------------------------- owners of worlds


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Track the running test."""
    with item.config.stash[_OWNERS].running(item):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(request: pytest.FixtureRequest) -> Generator[None, Any, Any]:
    """Track the fixture that is set up."""
    with request.config.stash[_OWNERS].setting_up(request):
        return (yield)


# ---------------------------------------------------------------------- reports


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add state, setup, files and the command that repeats the test to the report of a failed test."""
    if call.excinfo is not None and isinstance(item, pytest.Function):
        _hide_frames_below_test(call.excinfo)
    report = yield
    if report.failed and call.when != "teardown":
        reason = str(call.excinfo.value) if call.excinfo is not None else ""
        try:
            _report_failure(item, report, reason)
        except Exception as error:  # the test's own failure must be reported in any case
            report.sections.append((_SECTION, f"no report of the flight: {error!r}"))
    return report


def _hide_frames_below_test(error: pytest.ExceptionInfo[BaseException]) -> None:
    """Hide the frames below the test in the traceback of a refusal, such as that of a bad argument of a World.

    Other errors are defects of this project or of the test, and show all frames.
    """
    frames = error.traceback
    modules = [str(entry.frame.f_globals.get("__name__")) for entry in frames]
    packages = [module.partition(".")[0] for module in modules]
    if not any(name.startswith(_TESTING) for name in modules):
        return
    if packages[-1] not in _OURS or not _is_refusal(error, modules[-1]):
        return
    for entry, package in zip(frames, packages, strict=True):
        if (
            package in _BELOW_TESTS and entry.frame.code.name != "<module>"
        ):  # whose names are those of its module
            entry.frame.f_locals["__tracebackhide__"] = True


def _is_refusal(error: pytest.ExceptionInfo[BaseException], module: str) -> bool:
    """Return True for an error of ``_REFUSALS``, and for one that a ``raise`` in ``_ARGUMENTS`` made."""
    own = {kind.__name__ for kind in error.type.__mro__ if kind.__module__.partition(".")[0] in _OURS}
    if own & _REFUSALS:
        return True
    last = error.traceback[-1]._rawentry
    is_raised = last.tb_frame.f_code.co_code[last.tb_lasti] == opmap["RAISE_VARARGS"]
    return module in _ARGUMENTS and is_raised and issubclass(error.type, (TypeError, ValueError))


def _report_failure(item: pytest.Item, report: pytest.TestReport, reason: str) -> None:
    evidence = _evidence(item)
    servers = item.config.stash.get(_SERVERS, None) if "sitl_server" in _fixtures(item) else None
    running = servers.running if servers is not None else []
    if evidence is None and not running:
        return
    artifacts = _artifacts(item.config)
    lines: list[str] = []
    if evidence is not None:
        kept = artifacts.keep(item.nodeid, evidence, reason.partition("\n")[0])
        lines += [*evidence.lines, *kept.lines]
        item.user_properties += kept.properties  # of the JUnit file, which has those of the test
        report.user_properties += kept.properties
        _attach(item.config, report, kept.properties)
    for number, server in enumerate(running, 1):  # two may have had one instance, one after the other
        folder = artifacts.folder(item.nodeid) / f"server-{number}"
        server.keep_in(folder)
        lines += [*server.lines(), f"files:   {folder} (after the test)"]
    lines.append(f"repeat:  {_command(item)}")
    report.sections.append((_SECTION, "\n".join(lines)))


def _fixtures(item: pytest.Item) -> Sequence[str]:
    return getattr(item, "fixturenames", ())


def _evidence(item: pytest.Item) -> Evidence | None:
    """Return what a failed test leaves, or None if it has flown nothing in this process."""
    of_scenario: Evidence | None = getattr(item, "flightstack_evidence", None)
    if of_scenario is not None:
        return of_scenario
    sitl = item.config.stash.get(_SITL, None) if "sitl" in _fixtures(item) else None
    flown = sitl.latest(item) if sitl is not None else None
    return None if flown is None else flown.evidence()


def _command(item: pytest.Item) -> str:
    from flightstack.testing.artifacts import repeat_command

    return repeat_command(item.nodeid, item.config.rootpath, item.config.invocation_params.dir)


def _attach(config: pytest.Config, report: pytest.TestReport, files: list[tuple[str, object]]) -> None:
    """Add links to the report of pytest-html, if it is installed."""
    if config.pluginmanager.hasplugin("html"):
        from pytest_html import extras

        links = [
            extras.url(Path(str(path)).as_uri(), name=name.removeprefix("flightstack_"))
            for name, path in files
        ]
        report.__dict__.setdefault("extras", []).extend(links)


# ---------------------------------------------------------------------- scenario files


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Collect scenario files: a test for each seed."""
    if file_path.suffix != ".toml" or not _may_be_scenario(file_path):
        return None
    from flightstack.testing.pytest_items import ScenarioFile

    return ScenarioFile.of(file_path, parent)


def _may_be_scenario(path: Path) -> bool:
    """Return True if the check of the file's content is worth its imports."""
    try:
        return b"expect" in path.read_bytes()
    except OSError:
        return False
