"""Command lines of the three programs: common appearance and shared options."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from flightstack import __version__
from flightstack.process.console import checked_code

UsageError: Any = typer.BadParameter.__mro__[1]
"""Base class of usage errors: typer has its own copy of click in some versions."""

_NUMBERS = {"int": "a whole number", "float": "a number", "finite": "a finite number"}
"""Pydantic's error types for values that are no number, by their first word."""

_TYPER_INTERRUPTED = 130
"""Exit code of typer for a KeyboardInterrupt."""

HELP_FLAGS = ("-h", "--help")

PANELS = (
    "Vehicle and parameters",
    "Loops and timing",
    "Simulation",
    "Disturbances and faults",
    "Links",
    "Output",
)
"""Titles of the groups of options, in the order of the help."""
_IN_PANEL: Any = [{"rich_help_panel": title} for title in PANELS]
IN_VEHICLE, IN_LOOPS, IN_SIMULATION, IN_DISTURBANCES, IN_LINKS, IN_OUTPUT = _IN_PANEL
_EXTRA = re.compile(r"Got unexpected extra arguments?(?:\(s\))? \((.*)\)", re.DOTALL)


def usage_sentence(error: Any) -> str:
    """Return the sentence of a usage error; for a wrong number it names option, value and range.

    Typer checks numbers with Pydantic, whose messages have neither value nor range.
    """
    problems: list[Any] = getattr(error.__cause__, "errors", list)()
    if not problems or getattr(error, "param", None) is None:
        return _plain(error)
    kind, value = problems[0]["type"], problems[0]["input"]
    name = max(getattr(error.param, "opts", None) or [error.param.name], key=len)
    info = error.param.type_descriptor.parameter_info
    ends = (info.min, info.max)
    limits = f"{ends[0]:.10g} to {ends[1]:.10g}" if None not in ends else f"at least {ends[0]}"
    if kind in ("greater_than_equal", "less_than_equal"):
        return f"{name}: {value} is outside the allowed range {limits}"
    wanted = _NUMBERS.get(kind.split("_")[0])
    if wanted is None:
        return _plain(error)
    return f"{name}: {value!r} is not {wanted}" + (f"; give {limits}" if ends != (None, None) else "")


def _plain(error: Any) -> str:
    sentence = str(error.format_message()).replace("Value error, ", "")  # of Pydantic
    extra = _EXTRA.fullmatch(sentence)
    if extra is not None and error.ctx is not None:
        return _about_extra(extra[1], error.ctx)
    about = getattr(getattr(error, "param", None), "help", None)
    if type(error).__name__ != "MissingParameter" or not about:
        return sentence
    begin = about[0] if about[1:2].isupper() else about[0].lower()  # an abbreviation keeps its capitals
    return f"{sentence.rstrip('.')}: {begin}{about[1:].rstrip('.')}"


def argument_form(argument: Any) -> str:
    """Return an argument as usage and help show it, without Typer's braces and type.

    A metavar with brackets or dots is complete.
    """
    name: str = argument.metavar or argument.name.upper()
    if name.startswith("[") or name.endswith("..."):
        return name
    shown = name if argument.required else f"[{name}]"
    return shown if argument.nargs == 1 else f"{shown}..."


def _about_extra(words: str, context: Any) -> str:
    """Return the sentence about arguments that a command does not take; a recording is the value of an option."""
    path = context.command_path
    sentence = f"{path.partition(' ')[2] or path} takes no argument {words}"
    takes_link = any("--connect" in param.opts for param in context.command.params)
    return (
        f"{sentence}: give a recording as --connect {words}"
        if takes_link and words.endswith(".tlog") and len(words.split()) == 1
        else sentence
    )


class _Panels:
    """Lists the options of a command under the titles of ``panels``, those of no panel at the end.

    Typer does so with markup only.
    """

    panels: ClassVar[tuple[str, ...]] = PANELS

    def collect_usage_pieces(self: Any, ctx: Any) -> list[str]:
        """Return the parts of the usage line after the name of the command."""
        forms = {
            piece: argument_form(param)
            for param in self.get_params(ctx)
            if param.param_type_name == "argument"
            for piece in param.get_usage_pieces(ctx)
        }
        return [forms.get(piece, piece) for piece in super().collect_usage_pieces(ctx)]  # type: ignore[misc]

    def format_options(self: Any, ctx: Any, formatter: Any) -> None:
        titles = ("Arguments", *self.panels, "Options")
        sections: dict[str, list[tuple[str, str]]] = {title: [] for title in titles}
        for param in self.get_params(ctx):
            is_argument = param.param_type_name == "argument"
            panel = getattr(param, "rich_help_panel", None) or "Options"
            title = "Arguments" if is_argument else panel if panel in sections else "Options"
            record = param.get_help_record(ctx)
            if record is not None:
                sections[title].append((argument_form(param), record[1]) if is_argument else record)
        for title, records in sections.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


class PanelCommand(_Panels, TyperCommand):
    """A command with many options."""


class _Command(_Panels, TyperCommand):
    """A command with few options."""

    panels = ()


class PanelGroup(_Panels, TyperGroup):
    """A group with many options of its own."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """List options, then commands."""
        super().format_options(ctx, formatter)
        self.format_commands(ctx, formatter)


class _App(typer.Typer):
    """A command line whose commands show their arguments as ``argument_form`` does."""

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """Add a command."""
        return super().command(name, **{"cls": _Command, **settings})


def make_app(**settings: Any) -> typer.Typer:
    """Return a command line with plain-text help: brackets in it are no markup."""
    return _App(
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": list(HELP_FLAGS)},
        **settings,
    )


def expand_options(command: Callable[..., None], without: Collection[str] = ()) -> Callable[..., None]:
    """Replace each dataclass among the parameters of a command by one option per field.

    A field is an option if its type is ``Annotated`` and its name is not in ``without``. Fields of one name, and
    a parameter of the command with that name, get the value of one option.
    """
    groups: dict[str, tuple[Any, list[inspect.Parameter]]] = {}
    parameters: list[inspect.Parameter] = []
    own = set(inspect.signature(command).parameters)
    seen: set[str] = set()
    for name, parameter in inspect.signature(command, eval_str=True).parameters.items():
        if dataclasses.is_dataclass(parameter.annotation):
            groups[name] = parameter.annotation, _options_of(parameter.annotation, without)
            parameters += [option for option in groups[name][1] if option.name not in own | seen]
            seen |= {option.name for option in groups[name][1]}
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))

    @functools.wraps(command)
    def run(**given: Any) -> None:
        built = {
            name: group(**{option.name: given[option.name] for option in options})
            for name, (group, options) in groups.items()
        }
        command(**built, **{name: value for name, value in given.items() if name in own})

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _options_of(group: Any, without: Collection[str]) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=_default(field), annotation=hints[field.name]
        )
        for field in dataclasses.fields(group)
        if field.name not in without and hasattr(hints[field.name], "__metadata__")
    ]


def _default(field: dataclasses.Field[Any]) -> Any:
    return inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default


def run_app(app: typer.Typer, name: str, arguments: Sequence[str] | None = None) -> int:
    """Run a command line; return its exit code. An interrupt, of which typer makes an exit code, is raised again.

    Raise OSError if its output was lost.
    """
    try:
        code = app(arguments, prog_name=name, standalone_mode=False)
    except typer.Abort:
        raise KeyboardInterrupt from None
    if code == _TYPER_INTERRUPTED:
        raise KeyboardInterrupt
    return checked_code(code)


def _print_version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        print(f"{context.find_root().info_name} {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
]

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.", **IN_OUTPUT)]


@dataclasses.dataclass(frozen=True)
class PictureOptions:
    """Options of ``gcs log draw`` and ``sim-bridge render``, as given; None where not given."""

    png: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a picture of the middle of the flight, or of the time --at."
        ),
    ] = None
    sheet: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write nine times, or those of --at, in one picture.")
    ] = None
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a film: .mp4 (needs an even size) or .gif.")
    ] = None
    view: Annotated[bool, typer.Option("--view", help="Play the flight in a window.")] = False
    at: Annotated[
        str | None,
        typer.Option(metavar="T1[,T2,…]", help="Times of the pictures, s; several write numbered files."),
    ] = None
    camera: Annotated[
        str,
        typer.Option(metavar="NAME", help="chase, fixed, top, side, or whole (the whole path from above)."),
    ] = "chase"
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Pixels.  [default: 1280x720; 480x270 for a gif]")
    ] = None
    fps: Annotated[
        float | None, typer.Option(metavar="N", help="Frames per second.  [default: 30; 12.5 for a gif]")
    ] = None
    begin: Annotated[
        float | None, typer.Option("--from", metavar="SECONDS", help="Start of the film, s.")
    ] = None
    end: Annotated[float | None, typer.Option("--to", metavar="SECONDS", help="End of the film, s.")] = None
    speed: Annotated[
        float | None,
        typer.Option(metavar="FACTOR", help="Speed of the playback over that of the flight.  [default: 1]"),
    ] = None
    no_words: Annotated[
        bool, typer.Option("--no-words", help="Omit figures, waypoint numbers and scale.")
    ] = False
    overwrite: Overwrite = False

    def arguments(self) -> list[str]:
        """Return the same options as command line arguments."""
        given = {
            "--png": self.png, "--sheet": self.sheet, "--video": self.video, "--at": self.at,
            "--camera": self.camera, "--size": self.size, "--fps": self.fps, "--from": self.begin,
            "--to": self.end, "--speed": self.speed,
        }  # fmt: skip
        flags = {"--view": self.view, "--no-words": self.no_words, "--overwrite": self.overwrite}
        return [
            *(f"{flag}={value}" for flag, value in given.items() if value is not None),
            *(flag for flag, is_set in flags.items() if is_set),
        ]


# options of ``sim-bridge`` that ``gcs fly`` and ``gcs pil`` offer too
VEHICLE = typer.Option(
    metavar="NAME|FILE", help="Built-in vehicle (paper_quad, x_quad) or a TOML file.", **IN_VEHICLE
)
PLANT = typer.Option(
    metavar="PLANT", help="rigid, multibody (MuJoCo), or paper (small angles).", **IN_SIMULATION
)
WIND = typer.Option(metavar="N,E[,D]", help="Steady wind, m/s.", **IN_DISTURBANCES)
GUST = typer.Option(metavar="SIGMA", help="Standard deviation of the gusts, m/s.", **IN_DISTURBANCES)
DRAG = typer.Option(
    "--drag", help="Use the optional drag of the vehicle file, so that wind acts.", **IN_DISTURBANCES
)
FORCE = typer.Option(metavar="N,E,D", help="Constant external force, N.", **IN_DISTURBANCES)
TORQUE = typer.Option(metavar="X,Y,Z", help="Constant external torque, body FRD, N m.", **IN_DISTURBANCES)
TORQUE_GUST = typer.Option(
    metavar="SIGMA", help="Standard deviation of a gusty torque about roll and pitch, N m.", **IN_DISTURBANCES
)
SEED = typer.Option(metavar="N", help="Seed of the gusts, a whole number.", **IN_DISTURBANCES)
SPEED = typer.Option(metavar="max|N", help="N times real time, or max: as fast as possible.", **IN_SIMULATION)
IDEAL_ROTORS = typer.Option(
    "--ideal-rotors", help="Rotors without limits, lag and spin-up torque.", **IN_VEHICLE
)
PHYSICS_HZ = typer.Option(metavar="HZ", help="Lowest integration rate.", **IN_SIMULATION)
SLOPE = typer.Option(
    metavar="DEG", help="The ground rises by this to the north; rigid plant.", **IN_SIMULATION
)
BOAT = typer.Option(metavar="N,E", help="Velocity of the ground, as of a boat, m/s.", **IN_SIMULATION)
BATTERY_START = typer.Option(metavar="PERCENT", help="Initial charge.  [default: 100]", **IN_VEHICLE)
BATTERY_CAPACITY = typer.Option(
    metavar="MAH", help="Battery capacity.  [default: the vehicle's]", **IN_VEHICLE
)
BATTERY_DRAIN = typer.Option(metavar="FACTOR", help="Factor on the discharge.  [default: 1]", **IN_VEHICLE)
FAULTS = typer.Option(
    "--fault",
    metavar="FAULT[@BEGIN[-END]]",
    help="Fault or disturbance, such as rotor:2:off@10-20 or 'payload 0.3 at 0.1,0,0.05 @12'; may be repeated. "
    "All of them: docs/reference/faults.md.",
    **IN_DISTURBANCES,
)
VIEW = typer.Option("--view", help="Show the vehicle in a window.", **IN_SIMULATION)
