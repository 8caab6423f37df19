"""Ground stations by the dozen, noise, and a client that never reads: the load of ``ground_load``.

Arguments: instance, stations, datagrams of noise a second, clients that never read. Prints, when its standard
input ends, a line of JSON: how many frames each station received, and for how long.
"""

from __future__ import annotations

import json
import random
import select
import socket
import sys
import time

from flightstack.core.port_numbers import tcp_port, vehicle_ground_port
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link

_NOISE_SIZE = 280  # as long as the longest frame, as noise on a line would be
_HOST = "127.0.0.1"


class Load:
    """All clients, in one loop."""

    def __init__(self, instance: int, stations: int, noise_hz: float, lazy: int) -> None:
        self._vehicle = (_HOST, vehicle_ground_port(instance))
        self._stations = [_udp() for _ in range(stations)]
        self._links = [Link(255 - index % 50, 190) for index in range(stations)]
        self._received = [0] * stations
        self._index = {station.fileno(): index for index, station in enumerate(self._stations)}
        self._lazy = [socket.create_connection((_HOST, tcp_port(instance))) for _ in range(lazy)]
        for client in self._lazy:
            client.sendall(_heartbeat(Link(240, 190)))
        self._noise = _udp()
        self._noise_hz = noise_hz
        chance = random.Random(1)
        self._pieces = [chance.randbytes(_NOISE_SIZE) for _ in range(997)]

    def run(self) -> None:
        """Run until standard input ends."""
        poller = select.poll()
        poller.register(sys.stdin, select.POLLIN)
        for station in self._stations:
            poller.register(station, select.POLLIN)
        began_s = time.perf_counter()
        beats, pieces = 0, 0
        while True:
            elapsed_s = time.perf_counter() - began_s
            while beats < elapsed_s * len(self._stations):  # each once a second, one after the other
                index = beats % len(self._stations)
                self._stations[index].sendto(_heartbeat(self._links[index]), self._vehicle)
                beats += 1
            while pieces < elapsed_s * self._noise_hz:
                self._noise.sendto(self._pieces[pieces % len(self._pieces)], self._vehicle)
                pieces += 1
            for fileno, _ in poller.poll(2 if self._noise_hz else 20):
                if fileno == sys.stdin.fileno():
                    print(json.dumps({"seconds": elapsed_s, "frames": self._received, "noise": pieces}))
                    return
                self._read(self._index[fileno])

    def _read(self, index: int) -> None:
        try:
            while True:
                self._stations[index].recv(2048)
                self._received[index] += 1
        except BlockingIOError:
            pass


def _udp() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((_HOST, 0))
    made.setblocking(False)
    return made


def _heartbeat(link: Link) -> bytes:
    return link.encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))


if __name__ == "__main__":
    Load(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])).run()
