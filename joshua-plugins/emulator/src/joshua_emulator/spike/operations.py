"""Operations of the control channel for an emulated hub."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from joshua_emulator.control import ControlError
from joshua_emulator.fault_rules import PLAIN, PROBABILITY, RETURNS, FaultRule, Number, Text
from joshua_emulator.operations import Action, DeviceOperations, Request
from joshua_emulator.spike.machine import HubMachine
from joshua_emulator.spike.motors import EmulatedMotor
from joshua_emulator.spike.program import OTHER_PROGRAM, pack

_FIRMWARES = ("lego", "old", "pybricks")


def fault_rules(ports: Sequence[str]) -> dict[str, FaultRule]:
    """Return the fault rules of a hub with motors on these ports."""
    port = FaultRule(Text(", ".join(ports), "|".join(ports)))
    return {
        **dict.fromkeys(("stall", "motor_off", "sensor"), port),
        "corrupt": PROBABILITY,
        "slow": FaultRule(Number("seconds from 0 to 10", 0, 10)),
        "battery": FaultRule(Number("0 to 9000 mV", 0, 9000, whole=True)),
        "unplug": RETURNS,
        "replug": PLAIN,
        "out_of_range": RETURNS,
        "in_range": PLAIN,
        "firmware": FaultRule(Text(", ".join(_FIRMWARES), "|".join(_FIRMWARES))),
        "flaky": FaultRule(Number("a number of connections from 0 to 1000", 0, 1000, whole=True)),
        "button": PLAIN,
        "other_program": PLAIN,
    }


class HubOperations(DeviceOperations):
    """Operations by name. ``handle`` is the control channel's handler."""

    def __init__(self, machine: HubMachine) -> None:
        super().__init__(machine.log, fault_rules(tuple(machine.motors)))
        self._machine = machine
        self.operations = {
            "state": self._state,
            "log": self.read_log,
            "hand": self._hand,
            "motion": self._motion,
            "guide": self._guide,
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: machine.stop(),
        }
        self._faults: dict[str, Callable[[Request], Action]] = {
            "stall": lambda request: self._set(self._motor(request), "blocked", True),
            "motor_off": lambda request: self._set(self._motor(request), "attached", False),
            "sensor": lambda request: self._set(self._motor(request), "device", 61),
            "corrupt": lambda request: self._set(machine.hub, "corrupt", float(request["value"])),
            "slow": lambda request: self._set(machine.radio.air, "interval_s", float(request["value"])),
            "battery": lambda request: self._set(machine.hub, "battery_mv", int(request["value"])),
            "unplug": lambda _: machine.off,
            "replug": lambda _: machine.on,
            "out_of_range": lambda _: lambda: machine.soon(machine.radio.go(near=False)),
            "in_range": lambda _: machine.on,
            "firmware": self._firmware,
            "flaky": lambda request: self._set(machine.radio, "flaky", int(request["value"])),
            "button": lambda _: machine.hub.stop_program,
            "other_program": self._other_program,
        }

    def at(self, delay_s: float, action: Action) -> None:
        """Call ``action`` after a delay, on the loop of the hub."""
        self._machine.at(delay_s, action)

    def _state(self, _: Request) -> dict[str, Any]:
        machine = self._machine
        motors = {}
        for port, motor in machine.motors.items():
            angle, speed, load = motor.state()
            motors[port] = {
                "angle_deg": angle,
                "absolute_deg": motor.absolute_deg,
                "speed_deg_s": speed,
                "load_mnm": load,
                "powered": motor.powered,
                "blocked": motor.blocked,
            }
        return {
            "t_ns": time.monotonic_ns(),
            "running": machine.hub.running,
            "connected": machine.radio.connected,
            "battery_mv": machine.hub.battery_mv,
            "motors": motors,
        }

    def _hand(self, request: Request) -> None:
        """Turn a shaft without torque to ``absolute_deg``."""
        angle_deg = float(request["absolute_deg"])
        self._motor({"value": request["port"]}).hand(lambda now_s: angle_deg)

    def _motion(self, request: Request) -> None:
        values = {key: value for key, value in request.items() if key not in ("op", "kind")}
        if request["kind"] != "sine":
            raise ControlError(f"motion is {request['kind']!r}; allowed: sine")
        self._machine.start_motion(values)

    def _guide(self, request: Request) -> None:
        """Move the shafts as a calibration asks: ``slot`` through its range, or all to their middles."""
        slot = request.get("slot")
        if slot is not None and slot not in range(len(self._machine.motors)):
            raise ControlError(f"slot is {slot!r}; allowed: 0 to {len(self._machine.motors) - 1}")
        self._machine.guide(slot, float(request["seconds"]))

    def fault(self, request: Request) -> None:
        """Inject a fault; after ``replug_after_s`` the hub is on and in range again."""
        super().fault(request)
        if back_s := float(request.get("replug_after_s", 0.0)):
            self.later(float(request.get("at_s", 0.0)) + back_s, self._machine.on)

    def fault_action(self, kind: str, request: Request) -> Action:
        """The action that injects a valid fault."""
        return self._faults[kind](request)

    def _firmware(self, request: Request) -> Action:
        machine = self._machine
        return lambda: machine.soon(machine.radio.set_firmware(request["value"]))

    def _other_program(self, _: Request) -> Action:
        blob = pack(OTHER_PROGRAM.read_bytes())
        return lambda: self._machine.on_loop(lambda: self._machine.hub.run(blob))

    def _clear_faults(self, _: Request) -> None:
        """Clear all faults that can be cleared; the battery is full again."""
        machine = self._machine
        for motor in machine.motors.values():
            motor.blocked, motor.attached, motor.device = False, True, EmulatedMotor().device
        machine.hub.corrupt = machine.radio.air.interval_s = 0.0
        machine.hub.battery_mv = 8100
        if machine.radio.firmware != "pybricks":
            machine.soon(machine.radio.set_firmware("pybricks"))
        elif not machine.radio.connected:
            machine.on()

    def _motor(self, request: Request) -> EmulatedMotor:
        port = request["value"]
        if port not in self._machine.motors:
            raise ControlError(f"port is {port!r}; allowed: {', '.join(self._machine.motors)}")
        return self._machine.motors[port]

    @staticmethod
    def _set(thing: object, name: str, value: object) -> Action:
        return lambda: setattr(thing, name, value)
