"""Output of ``sim-bridge``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from flightstack.process import console

if TYPE_CHECKING:
    from flightstack.params.vehicle import Vehicle


def say(text: object) -> None:
    """Print a line for the user."""
    console.say(f"sim-bridge: {text}")


def complain(text: object) -> None:
    """Print a warning or an error."""
    console.complain(f"sim-bridge: {text}")


def load_named_vehicle(name: str) -> Vehicle:
    """Load the vehicle of ``--vehicle``; warn if a built-in vehicle hides a file of that name. Raises ConfigError."""
    from flightstack.params.vehicle import hidden_vehicle, load_vehicle  # noqa: PLC0415

    if (sentence := hidden_vehicle(name)) is not None:
        complain(sentence)
    return load_vehicle(name)


def print_result(text: str) -> None:
    """Print the result of a command; raise typer.Exit if it cannot be written."""
    error = console.say(text)
    if error is None:
        return
    if not isinstance(error, BrokenPipeError):  # the reader closed the pipe, which is no error
        complain(f"cannot write the result: {getattr(error, 'strerror', None) or error}")
    raise typer.Exit(1)
