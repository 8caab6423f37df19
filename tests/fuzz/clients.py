"""Every client of the ground station, with an operation under way."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from gcs_cli.clients.command_client import CommandClient
from gcs_cli.clients.ftp_client import FtpClient
from gcs_cli.clients.log_client import LogClient, LogEntry
from gcs_cli.clients.mission_client import MissionClient
from gcs_cli.clients.param_client import ParamClient
from gcs_cli.link.session import Service
from tests.support.plan_items import item

VEHICLE, OWN = Address(1, 1), Address(255, 190)


def upload() -> Service:
    client = MissionClient(VEHICLE, OWN)
    client.start_upload([item(22, z=8.0), item(16, 10.0, 5.0, 8.0), item(21, 10.0, 5.0)])
    return client


def download() -> Service:
    client = MissionClient(VEHICLE, OWN)
    client.start_download()
    return client


def command() -> Service:
    client = CommandClient(VEHICLE, OWN)
    client.send(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), 0.0)
    return client


def parameter_list() -> Service:
    client = ParamClient(VEHICLE, OWN)
    client.start_list()
    return client


def parameter_set() -> Service:
    client = ParamClient(VEHICLE, OWN)
    client.start_set("MPC_XY_CRUISE", 3.0)
    return client


def file() -> Service:
    client = FtpClient(VEHICLE, OWN)
    client.start_download("@PARAM/param.pck")
    return client


def directory() -> Service:
    client = FtpClient(VEHICLE, OWN)
    client.start_list("/")
    return client


def log_list() -> Service:
    client = LogClient(VEHICLE)
    client.start_list()
    return client


def log() -> Service:
    client = LogClient(VEHICLE)
    client.start_download(LogEntry(1, 100_000, 0))
    return client


SERVICES = [upload, download, command, parameter_list, parameter_set, file, directory, log_list, log]
