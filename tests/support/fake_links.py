"""Scripted vehicles on streams: TCP clients and servers, and pseudo-terminals as serial ports."""

from __future__ import annotations

import os
import pty
import select
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from flightstack.mavlink.link import Link
from flightstack.transports.udp import UdpSocket
from tests.support.fake_vehicle import STEP_S, FakeVehicle


@contextmanager
def running(step: Callable[[], object], stopped: threading.Event | None = None) -> Iterator[None]:
    """Call ``step`` again and again in a thread."""
    stopped = stopped or threading.Event()

    def run() -> None:
        while not stopped.is_set():
            step()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


def exchange(vehicle: FakeVehicle, descriptor: int) -> bool:
    """Pass data between ``vehicle`` and a stream once; return False at its end."""
    if select.select([descriptor], [], [], STEP_S)[0]:
        try:
            data = os.read(descriptor, 4096)
        except OSError:
            return False
        if not data:
            return False
        vehicle.receive(data, time.monotonic())
    try:
        os.write(descriptor, b"".join(vehicle.poll(time.monotonic())))
    except OSError:
        return False
    return True


@contextmanager
def tcp_server(vehicle: FakeVehicle) -> Iterator[int]:
    """Serve ``vehicle`` to one TCP client at a time, and yield the port."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(STEP_S)
        stopped = threading.Event()

        def step() -> None:
            try:
                connection = listener.accept()[0]
            except TimeoutError:
                return
            with connection:
                vehicle.make_heartbeat_due()
                while not stopped.is_set() and exchange(vehicle, connection.fileno()):
                    pass

        with running(step, stopped):
            yield int(listener.getsockname()[1])


@contextmanager
def tcp_client(vehicle: FakeVehicle, port: int, listening: threading.Event) -> Iterator[None]:
    """Connect ``vehicle`` to a TCP port once it is ``listening``, until that connection ends."""
    stopped = threading.Event()

    def step() -> None:
        if not listening.wait(STEP_S):
            return
        listening.clear()
        with socket.create_connection(("127.0.0.1", port)) as connection:
            vehicle.make_heartbeat_due()
            while not stopped.is_set() and exchange(vehicle, connection.fileno()):
                pass

    with running(step, stopped):
        yield


@contextmanager
def serial_device(vehicle: FakeVehicle) -> Iterator[str]:
    """Connect ``vehicle`` to a pseudo-terminal, and yield the device."""
    master, slave = pty.openpty()
    tty.setraw(master)
    try:
        with running(lambda: exchange(vehicle, master)):
            yield os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


def target_of(frame: bytes) -> int:
    """Return the system that a frame is addressed to; 0: all."""
    return max((getattr(message, "target_system", 0) for message in Link(0, 0).decode(frame)), default=0)


@contextmanager
def udp_vehicles(*vehicles: FakeVehicle, to_port: int | None = None) -> Iterator[int]:
    """Serve several vehicles at one UDP port, as a router does, and yield the port."""
    with UdpSocket("127.0.0.1") as udp:
        peers = [] if to_port is None else [("127.0.0.1", to_port)]

        def step() -> None:
            udp.wait(STEP_S)
            for data, sender in udp.receive():
                peers[:] = [sender]
                for vehicle in vehicles:
                    if target_of(data) in (0, vehicle.system_id):
                        vehicle.receive(data, time.monotonic())
            for peer in peers:
                for vehicle in vehicles:
                    for frame in vehicle.poll(time.monotonic()):
                        udp.send(frame, peer)

        with running(step):
            yield udp.address[1]
