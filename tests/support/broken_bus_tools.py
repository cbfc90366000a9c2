"""Bus tools whose motors are a few numbers behind a real port, and others that each break one clause."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from joshua_serial.errors import PortDisconnected
from joshua_serial.port import SerialPort
from joshua_servo.bus_tools import AssignmentFailed, BusTools, FoundMotor


@dataclass
class Bus:
    """Motors by place: id and line speed of each."""

    motors: list[tuple[int, int]] = field(default_factory=lambda: [(1, 115_200), (2, 115_200)])
    unplugged: bool = False


class Tools(BusTools):
    """Keeps the contract."""

    family: ClassVar[str] = "toy motors"
    baudrates: ClassVar[tuple[int, ...]] = (115_200, 57_600, 38_400)
    ids: ClassVar[range] = range(10)
    expected_models: ClassVar[tuple[str, ...]] = ("Toy",)

    bus: ClassVar[Bus]

    def describe(self, motor_id: int, speed: int) -> FoundMotor:
        return FoundMotor(motor_id, speed, "Toy", voltage_v=12.0, temperature_c=30.0)

    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        former = self.port.baudrate
        try:
            for speed in baudrates or self.baudrates:
                self.require_plugged()
                self.port.set_baudrate(speed)
                for motor_id, its_speed in sorted(self.bus.motors):
                    if its_speed == speed:
                        yield self.describe(motor_id, speed)
        finally:
            self.port.set_baudrate(former)

    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        self.require_plugged()
        self.refuse(motor, motor_id, baudrate)
        place = self.bus.motors.index((motor.motor_id, motor.baudrate))
        self.write(place, motor_id, baudrate)
        return self.describe(*self.bus.motors[place])

    def refuse(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        if motor_id not in self.ids or baudrate not in self.baudrates or motor.shared:
            raise AssignmentFailed(f"{motor} cannot get id {motor_id} at {baudrate} bit/s")
        self.require_free(motor, motor_id, baudrate)
        if (motor.motor_id, motor.baudrate) not in self.bus.motors:
            raise AssignmentFailed(f"{motor} does not answer")

    def require_free(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        itself = (motor.motor_id, motor.baudrate)
        if (motor_id, baudrate) != itself and (motor_id, baudrate) in self.bus.motors:
            raise AssignmentFailed(f"id {motor_id} is taken")

    def write(self, place: int, motor_id: int, baudrate: int) -> None:
        self.bus.motors[place] = (motor_id, baudrate)

    def require_plugged(self) -> None:
        if self.bus.unplugged:
            raise PortDisconnected("the adapter is gone")


class ClosesThePort(Tools):
    def __init__(self, port: SerialPort) -> None:
        super().__init__(port)
        port.close()


class OpensAHandle(Tools):
    def __init__(self, port: SerialPort) -> None:
        super().__init__(port)
        handles.append(os.open(os.devnull, os.O_RDONLY))


class NoFamily(Tools):
    family: ClassVar[str] = ""


class SpeedCodes(Tools):
    baudrates: ClassVar[tuple[int, ...]] = (115_200, 57_600, 115_200)


class FactoryIdMissing(Tools):
    factory_id: ClassVar[int] = 11


class NoModels(Tools):
    expected_models: ClassVar[tuple[str, ...]] = ()


class CollectsFirst(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Any:
        return list(super().scan(baudrates))


class FindsOne(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        for motor in super().scan(baudrates):
            yield motor
            return


class YieldsIds(Tools):
    def describe(self, motor_id: int, speed: int) -> Any:
        return motor_id


class ModelNumber(Tools):
    def describe(self, motor_id: int, speed: int) -> FoundMotor:
        return replace(super().describe(motor_id, speed), model="model 777")


class TenthsOfVolts(Tools):
    def describe(self, motor_id: int, speed: int) -> FoundMotor:
        return replace(super().describe(motor_id, speed), voltage_v=120.0)


class Shared(Tools):
    def describe(self, motor_id: int, speed: int) -> FoundMotor:
        return replace(super().describe(motor_id, speed), shared=True)


class OtherOrder(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        yield from reversed(list(super().scan(baudrates)))


class MovesAMotorAtScan(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        yield from super().scan(baudrates)
        self.bus.motors[0] = (self.bus.motors[0][0] + 2, 115_200)


class LooksEverywhere(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        yield from super().scan()


class LeavesTheSpeed(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        former = self.port.baudrate
        yield from list(super().scan(baudrates))
        self.port.set_baudrate(57_600 if former == 115_200 else former)


class LeavesTheSpeedHalfWay(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        former = self.port.baudrate
        for speed in baudrates or self.baudrates:
            self.port.set_baudrate(speed)
            yield from (self.describe(i, s) for i, s in sorted(self.bus.motors) if s == speed)
        self.port.set_baudrate(former)


class WritesToAll(Tools):
    def write(self, place: int, motor_id: int, baudrate: int) -> None:
        for other in range(len(self.bus.motors)):
            super().write(other, motor_id, baudrate)


class OwnIdIsTaken(Tools):
    def require_free(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        if (motor_id, baudrate) in self.bus.motors:
            raise AssignmentFailed(f"id {motor_id} is taken")


class KeepsItsSpeed(Tools):
    def write(self, place: int, motor_id: int, baudrate: int) -> None:
        super().write(place, motor_id, self.bus.motors[place][1])


class TakesATakenId(Tools):
    def require_free(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        pass


class TakesAnything(Tools):
    def refuse(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        pass


class WritesBeforeItRefuses(Tools):
    def refuse(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        self.write(0, 7, 115_200)
        super().refuse(motor, motor_id, baudrate)


class IgnoresSilence(Tools):
    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        if (motor.motor_id, motor.baudrate) not in self.bus.motors:
            return self.describe(motor_id, baudrate)
        return super().assign(motor, motor_id, baudrate)


class FindsNobodyAfterUnplug(Tools):
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        if not self.bus.unplugged:
            yield from super().scan(baudrates)


handles: list[int] = []
