"""Arguments of the ``flightstack`` command."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(add_completion=False, context_settings={"help_option_names": ["-h", "--help"]})


@app.command()
def run(
    vehicle: Annotated[str, typer.Option(help="Built-in vehicle or TOML file.")] = "paper_quad",
    controller: Annotated[str, typer.Option(help="Attitude controller: pid, backstepping or yours.")] = "pid",
    gains: Annotated[str, typer.Option(help="Gains: tuned, paper or a TOML file.")] = "tuned",
    inner_hz: Annotated[float, typer.Option(help="Rate of the inner loop [Hz].")] = 500.0,
    outer_hz: Annotated[
        float | None,
        typer.Option(help="Rate of the outer loop [Hz]; divides the inner rate [nearest to 100]."),
    ] = None,
    clock: Annotated[str, typer.Option(help="lockstep (the simulator owns time) or realtime.")] = "lockstep",
    loops: Annotated[str, typer.Option(help="Which loops fly: python.")] = "python",
    sim_host: Annotated[str, typer.Option(help="Host of the simulator.")] = "127.0.0.1",
    sim_port: Annotated[int | None, typer.Option(help="Port of the simulator [4560 + instance].")] = None,
    sim_timeout: Annotated[float, typer.Option(help="Longest wait for the simulator [s].")] = 30.0,
    instance: Annotated[
        int, typer.Option(min=0, max=249, help="Number of this vehicle; shifts ports and id.")
    ] = 0,
    gcs: Annotated[
        list[str] | None,
        typer.Option(help="Ground station to address unasked: HOST:PORT. May be repeated [127.0.0.1:14550]."),
    ] = None,
    gcs_port: Annotated[int, typer.Option(help="UDP port of the ground station, without --gcs.")] = 14550,
    api_port: Annotated[
        int | None, typer.Option(help="UDP port of the API client [14540 + instance].")
    ] = None,
    tcp_port: Annotated[
        int | None, typer.Option(help="TCP port to listen on [5760 + 10 per instance]; 0 for none.")
    ] = None,
    listen: Annotated[
        str, typer.Option(help="Address of this machine to listen on for MAVLink; 0.0.0.0 for all.")
    ] = "127.0.0.1",
    signing_key: Annotated[
        Path | None,
        typer.Option(
            help="Sign MAVLink with the key in this file (made if missing); refuse what is unsigned."
        ),
    ] = None,
    allow_unsigned: Annotated[
        bool, typer.Option("--allow-unsigned", help="With --signing-key: take unsigned messages as well.")
    ] = False,
    log: Annotated[
        str | None,
        typer.Option(
            help="Log file [<stamp>-flight.ulg in runs, or runs/instance-<instance>]; 'none' for no log. "
            "Ground stations see the logs of its folder."
        ),
    ] = None,
    param: Annotated[
        list[str] | None, typer.Option(help="Set a parameter: NAME=VALUE. May be repeated.")
    ] = None,
    params: Annotated[
        str | None,
        typer.Option(
            help="Parameter file [runs/params-<instance>.params]; 'none' for none.", metavar="FILE|none"
        ),
    ] = None,
    home: Annotated[str | None, typer.Option(help="LATITUDE,LONGITUDE,ALTITUDE of the local origin.")] = None,
    ideal_rotors: Annotated[
        bool, typer.Option(help="Rotors without lag and limits, as the paper assumes.")
    ] = False,
    wait_for_start: Annotated[
        bool, typer.Option(help="Keep time at zero until a mission is started.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Check the configuration, compile the loops, end.")
    ] = False,
    exit_on_gcs_loss: Annotated[
        float | None, typer.Option(help="End when no ground station is heard [s].")
    ] = None,
) -> None:
    """Fly: connect to a simulator, run the control loops, and serve ground stations over MAVLink."""
    from flightstack.app import EXIT_USAGE, App, ProcessConfig
    from flightstack.assembly import build
    from flightstack.clock import nearest_outer_hz
    from flightstack.config import DEFAULT_HOME, StackConfig, parse_home
    from flightstack.logging.log_files import default_log
    from flightstack.params.errors import ConfigError
    from flightstack.params.param_file import begin_param_file
    from flightstack.ports import described, ports_config, warning
    from flightstack.transport.udp import PortBusyError

    try:
        if clock not in ("lockstep", "realtime"):
            raise ConfigError("--clock", clock, "is not one of lockstep, realtime")
        if allow_unsigned and signing_key is None:
            raise ConfigError("--allow-unsigned", "", "is for --signing-key: without a key all is unsigned")
        outer_rate = nearest_outer_hz(inner_hz) if outer_hz is None else outer_hz
        config = StackConfig(
            vehicle, controller, gains, loops, inner_hz, outer_rate, ideal_rotors, clock == "lockstep",
            DEFAULT_HOME if home is None else parse_home(home), instance + 1,
            params_file=None if params == "none" else params or f"runs/params-{instance}.params",
            params=tuple(param or []),
        )  # fmt: skip
        is_new = params not in (None, "none") and not Path(str(params)).exists()
        if is_new:
            print(
                f"flightstack: {params}: there is no such file: it begins with the defaults", file=sys.stderr
            )
        if check:
            vehicle_name = build(config, lambda: None).vehicle.name
            print(f"flightstack: {vehicle_name} with {controller} ({gains}) is ready to fly")
            return
        stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        path = default_log(instance, stamp) if log is None else Path(log)
        process = ProcessConfig(
            sim_host,
            4560 + instance if sim_port is None else sim_port,
            sim_timeout,
            ports_config(instance, gcs or [], gcs_port, api_port, listen, tcp_port),
            None if log == "none" else path,
            wait_for_start,
            exit_on_gcs_loss,
            signing_key,
            allow_unsigned,
        )
        if is_new:
            begin_param_file(Path(str(params)), instance + 1)
        stack = App(config, process)
    except (ConfigError, PortBusyError) as error:
        print(f"flightstack: {error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    if config.params_file is not None:
        unknown = stack.stack.loaded_params.warning(Path(config.params_file))
        if unknown is not None:
            print(f"flightstack: {unknown}", file=sys.stderr, flush=True)
    print(
        f"flightstack: {stack.stack.vehicle.name}, {controller} ({gains}), {inner_hz:g}/{outer_rate:g} Hz, {clock}; "
        f"simulator {sim_host}:{process.simulator_port}, {described(process.ports)}",
        flush=True,
    )
    if (caution := warning(process.ports, signed=signing_key is not None and not allow_unsigned)) is not None:
        print(f"flightstack: {caution}", file=sys.stderr, flush=True)
    sys.exit(stack.run())


def main() -> None:
    """Run the command."""
    app()


if __name__ == "__main__":
    main()
