"""What ``sim-bridge`` prints."""

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
    """Load the vehicle of ``--vehicle``; say when a file in the working directory is not what is meant.

    Raises ConfigError.
    """
    from flightstack.params.vehicle import hidden_vehicle, load_vehicle  # noqa: PLC0415

    if (sentence := hidden_vehicle(name)) is not None:
        complain(sentence)
    return load_vehicle(name)


def print_result(text: str) -> None:
    """Print what the command was called for; raise typer.Exit when it cannot be written."""
    error = console.say(text)
    if error is None:
        return
    if not isinstance(error, BrokenPipeError):  # a reader that closed the pipe has read enough
        complain(f"cannot write the result: {getattr(error, 'strerror', None) or error}")
    raise typer.Exit(1)
