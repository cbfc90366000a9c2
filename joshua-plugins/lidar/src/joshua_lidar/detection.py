"""Detection of the scanner on a port, and an explanation if it is not the expected one."""

from __future__ import annotations

import time

from joshua.api import DeviceError
from joshua.api.clocks import AwakeClock, witness
from joshua_serial.errors import PortUnusable
from joshua_serial.port import SerialPort

from joshua_lidar import requests
from joshua_lidar.models import MODELS, RPLIDAR_NUMBERS, YDLIDAR_NUMBERS, Model, same_stream
from joshua_lidar.parsers.ld06 import Ld06Parser
from joshua_lidar.parsers.lds01 import Lds01Parser
from joshua_lidar.parsers.ydlidar import YdlidarParser
from joshua_lidar.samples import Parser
from joshua_lidar.stop_bytes import STOP_BYTES

LISTEN_S = 0.4
ANSWER_S = 0.15

#: Factor on all timeouts if this process was stalled.
BUSY_FACTOR = 3.0

#: Longest wait for the first byte of any streaming scanner.
FIRST_BYTE_S = 0.3

#: An LDS-01 sends nothing until it turns.
SPIN_UP_S = 3.0

#: Packets in a row that are no coincidence.
_SURE = 6
_CHUNK = 128
_LDS01 = "lds01"


def detect(port: SerialPort) -> str:
    """Return the name of the model on a port at its present line speed; "" if none is found.

    A streaming scanner is recognised by its packets; others are queried. Raises PortDisconnected.
    """
    clock, began_s = witness(), time.monotonic()
    found = _detect(port, 1.0)
    if not found and clock.missed_s(began_s, time.monotonic()):
        found = _detect(port, BUSY_FACTOR)
    return found


def _detect(port: SerialPort, factor: float) -> str:
    requests.quieten(port)
    heard = _listen(port, LISTEN_S * factor)
    if heard:
        return heard
    for command, numbers in ((requests.GET_INFO, RPLIDAR_NUMBERS), (requests.YDLIDAR_INFO, YDLIDAR_NUMBERS)):
        info = requests.ask(port, requests.request(command), requests.INFO_ANSWER, ANSWER_S * factor)
        if info is not None and info.data[0] in numbers:
            return numbers[info.data[0]]
    if port.baudrate == MODELS[_LDS01].baudrate:
        port.send(b"b")
        heard = _listen(port, SPIN_UP_S)
        for message in STOP_BYTES[_LDS01]:
            port.send(message)
    return heard


def explain(port: SerialPort, expected: Model | None) -> DeviceError:
    """Return why a scanner does not reply as expected, after a search at every line speed."""
    asked_baudrate = port.baudrate
    what = f"a laser scanner ({expected.title})" if expected else "a laser scanner"
    bytes_seen = 0
    rates = [asked_baudrate, *sorted({model.baudrate for model in MODELS.values()} - {asked_baudrate})]
    for baudrate in rates:
        try:
            port.set_baudrate(baudrate)
        except PortUnusable:
            continue  # the scanner cannot use a speed that the adapter does not support
        port.discard_input()
        if baudrate == asked_baudrate:
            bytes_seen = len(port.receive(1, time.monotonic() + FIRST_BYTE_S))
        found = detect(port)
        if not found:
            continue
        model = MODELS[found]
        if baudrate != asked_baudrate:
            return DeviceError(
                f"{port}: {what} does not answer at {asked_baudrate} bit/s, but {model.one} does at "
                f"{baudrate}: set baudrate: {baudrate}"
                + (f' and model: "{found}"' if expected and not same_stream(found, expected.name) else "")
            )
        if expected and not same_stream(found, expected.name):
            return DeviceError(
                f'{port}: is {model.one}, but the file has model: "{expected.name}": '
                f'set model: "{found}", or plug the {expected.title} in'
            )
        if expected:
            return DeviceError(
                f"{port}: the {expected.title} answers, but does not start to measure: check its power "
                f"({expected.power})"
            )
    if bytes_seen:
        return DeviceError(
            f"{port}: sends data, but no known laser scanner sends such data at any line speed: check "
            f"comm.serial; known models are {', '.join(MODELS)}"
        )
    power = expected.power if expected else "5 V; many need more current than a USB 2 socket supplies"
    return DeviceError(
        f"{port}: no laser scanner answers at any line speed: check that it has power ({power}), that its "
        "data cable is plugged in, and comm.serial; joshua find-port lists the ports"
    )


def _listen(port: SerialPort, duration_s: float) -> str:
    """Return the name of the model whose packets arrive."""
    parsers: dict[str, Parser] = {
        "ld19": Ld06Parser(_SURE),
        _LDS01: Lds01Parser(_SURE),
        "ydlidar_x2": YdlidarParser(_SURE),
    }
    clock = AwakeClock()
    while (left_s := duration_s - clock.now_s()) > 0:
        data = port.receive(_CHUNK, time.monotonic() + min(left_s, 0.05))
        for name, parser in parsers.items():
            if len(parser.feed(data)):
                return name
    return ""
