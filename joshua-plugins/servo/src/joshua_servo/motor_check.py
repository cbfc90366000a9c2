"""Checks that the servos on a bus are those of the configuration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from joshua.api.patience import Patience
from joshua_serial.errors import PortUnusable

from joshua_servo.bus import ServoBus
from joshua_servo.bus_tools import FoundMotor
from joshua_servo.errors import MotorCheckFailed, NoReply

LOOKS = 2  # at each line speed, because one ping may be lost
COLLISIONS = 3  # of two servos that share an id, because a line may damage a reply
SCANNED_IDS = range(21)  # ids searched for unknown servos; arms are numbered from 1


def check_motors(bus: ServoBus, models: Mapping[int, str]) -> list[FoundMotor]:
    """Check each servo of the configuration, in cable order.

    Args:
        models: expected model of each servo by its id.

    Raises:
        MotorCheckFailed: a servo is missing, shares its id or has another model. The message names each, with
            the expected and found lists, and where the chain breaks.
        NoReply: the machine is too busy to tell whether a servo is missing.
        PortDisconnected: the port is gone.
    """
    ids = tuple(models)
    seen: dict[int, FoundMotor] = {}
    shared: list[int] = []
    silent = _silent(bus, ids)
    for servo_id in ids:
        if servo_id in silent:
            continue
        try:
            seen[servo_id] = bus.identify(servo_id)
        except NoReply as error:
            if not error.is_proof:
                raise
            if error.garbled:
                shared.append(servo_id)
    shared += [servo_id for servo_id in silent if _collides(bus, servo_id)]
    found = [seen[servo_id] for servo_id in ids if servo_id in seen]
    missing = [servo_id for servo_id in ids if servo_id not in seen and servo_id not in shared]
    wrong = [motor for motor in found if motor.model != models[motor.motor_id]]
    if not (missing or shared or wrong):
        return found
    strangers = [] if len(missing) == len(ids) else _strangers(bus, ids)
    problems = [
        *_missing_text(bus, ids, missing),
        *(f"two motors share the id {servo_id}: connect one alone and change its id" for servo_id in shared),
        *(
            f"wrong model: id {motor.motor_id} is a {motor.model}, expected {models[motor.motor_id]}"
            for motor in wrong
        ),
    ]
    raise MotorCheckFailed(
        "\n  ".join(
            [
                f"{bus.port}: motor check failed at {bus.port.baudrate} bit/s",
                *problems,
                f"expected: {_list(f'{servo_id} ({model})' for servo_id, model in models.items())}",
                f"found: {_list([*found, *strangers])}",
                "Run joshua motors setup to assign ids and baud rates, or joshua doctor to check cable and "
                "supply.",
            ]
        )
    )


def _silent(bus: ServoBus, ids: Sequence[int]) -> tuple[int, ...]:
    """Ids that leave their pings unanswered for as long as the patience with them lasts. Raises NoReply."""
    # A round takes hardly longer than one request, however many ids it pings: a reply that arrives during the
    # ping of a later id counts, too, so all ids of a round share one waiting time.
    patience = Patience(bus.patience_s, period_s=len(ids) * bus.reply_margin_s)
    silent = tuple(ids)
    while True:
        patience.begin()
        round_s = bus.wait_s(patience.misses, patience.left_s)
        heard = bus.roll_call(silent, max(bus.reply_margin_s, round_s / len(silent)))
        silent = tuple(servo_id for servo_id in silent if servo_id not in heard)
        if not silent:
            return ()
        if not patience.miss():
            break
    if not patience.is_silent:
        raise bus.explain("servos do not answer", "", patience)
    return silent


def _collides(bus: ServoBus, servo_id: int) -> bool:
    """Whether all replies of a servo are broken, because two servos have its id."""
    return all(bus.is_garbled(servo_id, 0, 2) for _ in range(COLLISIONS))


def find_baudrates(bus: ServoBus, ids: Iterable[int]) -> dict[int, list[int]]:
    """Find ids that reply at other line speeds, by speed. Restores the line speed."""
    usual = bus.port.baudrate
    answers: dict[int, list[int]] = {}
    wanted = list(ids)
    try:
        for _ in range(LOOKS):
            for baudrate in bus.baudrates:
                if baudrate != usual and (heard := _heard_at(bus, baudrate, wanted)):
                    answers[baudrate] = heard
            if answers:
                break
    finally:
        bus.port.set_baudrate(usual)
    return answers


def _heard_at(bus: ServoBus, baudrate: int, wanted: Sequence[int]) -> list[int]:
    """The ids that reply at a line speed. If one does, the others are asked again."""
    try:
        bus.port.set_baudrate(baudrate)
    except PortUnusable:
        return []  # a speed that the adapter does not support cannot be in use
    heard = bus.roll_call(wanted, bus.reply_margin_s)
    if heard:  # a late reply to a ping at another speed would not be repeated
        heard = bus.roll_call(sorted(heard), bus.reply_margin_s)
        heard |= bus.roll_call([i for i in wanted if i not in heard], bus.reply_margin_s)
    return [servo_id for servo_id in wanted if servo_id in heard]


def _missing_text(bus: ServoBus, ids: Sequence[int], missing: list[int]) -> list[str]:
    if not missing:
        return []
    if len(missing) == len(ids):
        answers = find_baudrates(bus, ids)
        if not answers:
            return ["no servo answers at any line speed: check the supply, and the cable to the first servo"]
        return [
            f"no servo answers at {bus.port.baudrate} bit/s, but ids {_list(heard)} answer at {baudrate}: "
            f"set baudrate: {baudrate}, or change the servos with joshua motors setup"
            for baudrate, heard in answers.items()
        ]
    texts = [f"missing ids: {_list(missing)}"]
    first = list(ids).index(missing[0])
    if first and list(ids[first:]) == missing:
        before = ids[first - 1]
        texts.append(f"the chain breaks after id {before}: check the cable between {before} and {missing[0]}")
    return texts


def _strangers(bus: ServoBus, ids: Sequence[int]) -> list[FoundMotor]:
    strangers = []
    heard = bus.roll_call([i for i in SCANNED_IDS if i not in ids], bus.reply_margin_s)
    for servo_id in sorted(heard.difference(ids)):
        try:
            strangers.append(bus.identify(servo_id))
        except NoReply:
            continue  # it replied only once, so it does not count as found
    return strangers


def _list(items: Iterable[object]) -> str:
    return ", ".join(str(item) for item in items) or "none"
