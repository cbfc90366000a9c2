"""Settings of a servo bus's driver, made from its block and the plan's calibration."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from google.protobuf.message import Message
from joshua.api import ActuatorSettings, BlockContext, FieldError, FromField, JointRange
from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration, ticks_to_rad
from joshua_serial.settings import SerialSettings
from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self

from joshua_servo.register import Register

MIDDLE_TICK = TICKS_PER_TURN // 2

_VID_PID = re.compile(r"[0-9a-fA-F]{4}:[0-9a-fA-F]{4}")


#: Name of the joint that is a gripper by default.
GRIPPER = "gripper"


class ServoJoint(BaseModel):
    """Settings of one servo. None keeps the servo's value or, for a gripper, means its default.

    Attributes:
        motor_id: None in an entry that applies to every servo.
        torque_limit_percent: of the stall torque; acceleration: in the unit of the bus's acceleration.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    #: Default settings of a gripper.
    gripper_defaults: ClassVar[Mapping[str, float]]

    motor_id: int | None = None
    gripper: bool | None = None
    torque_limit_percent: float | None = None
    position_p: int | None = None
    position_i: int | None = None
    position_d: int | None = None
    acceleration: int | None = None
    grip_load_percent: float | None = None
    grip_torque_percent: float | None = None
    grip_squeeze_rad: float | None = None

    @property
    def overload(self) -> tuple[float, float]:
        """Load in % that trips the servo, and its duration in s."""
        raise NotImplementedError(f"{type(self).__name__} has no overload")

    def over(self, general: Self | None) -> Self:
        """These settings, completed with those for every servo."""
        return self if general is None else self.model_copy(update=_given(general) | _given(self))

    def of_gripper(self) -> Self:
        """These settings, completed with the defaults of a gripper."""
        return self.model_copy(update={"gripper": True, **self.gripper_defaults} | _given(self))


#: Settings of the grip mode, for the defaults of a gripper.
GRIP_DEFAULTS: Mapping[str, float] = {
    "grip_load_percent": 15,
    "grip_torque_percent": 20,
    "grip_squeeze_rad": 0.05,
}


def _given(joint: ServoJoint) -> dict[str, Any]:
    return {name: value for name, value in joint if value is not None}


class ServoSettings(SerialSettings, ActuatorSettings):
    """Settings of the driver. Positions stay in ticks, the unit of the servo.

    Attributes:
        joint: settings of single servos.
        calibration: None if the arm is not calibrated.
    """

    #: Name of the servos in messages.
    servo_name: ClassVar[str]
    #: Supported line speeds and the factory setting, bit/s.
    line_speeds: ClassVar[tuple[int, ...]]
    factory_speed: ClassVar[int]
    #: Settings of one servo.
    joint_type: ClassVar[type[ServoJoint]]
    #: Registers behind the settings of a servo, and steps of the register in one unit of the setting.
    tuned: ClassVar[Mapping[str, tuple[Register, float]]]

    baudrate: Annotated[int, FromField("comm.serial.baudrate")] = 1_000_000
    motor_ids: tuple[int, ...] = Field(min_length=1)
    position_min_ticks: Annotated[int, FromField("position_min")] = 0
    position_max_ticks: Annotated[int, FromField("position_max")] = TICKS_PER_TURN - 1
    joint: tuple[ServoJoint, ...] = ()
    calibration: ArmCalibration | None = None

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the calibration of the arm."""
        result = super().si_values(values, node, context)
        if context.calibration is not None:
            result["calibration"] = ArmCalibration.values_of(context.calibration)
        return result

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages."""
        return f"a bus of {cls.servo_name} servos"

    @model_validator(mode="after")
    def _names_its_adapter(self) -> Self:
        if self.vid_pid and not _VID_PID.fullmatch(self.vid_pid):
            raise FieldError(
                "comm.serial.vid_pid",
                "a USB identity is two numbers of four hexadecimal digits",
                allowed=('"1a86:55d3"',),
                remedy="write vendor and product id as lsusb shows them",
            )
        return self

    @model_validator(mode="after")
    def _suits_the_servo(self) -> Self:
        if self.baudrate not in self.line_speeds:
            near = sorted(self.line_speeds, key=lambda rate: abs(rate - self.baudrate))
            raise FieldError(
                "comm.serial.baudrate",
                f"{self.servo_name} servos have no line speed of {self.baudrate} bit/s",
                allowed=tuple(str(rate) for rate in near),
                remedy="set the speed that the servos are set to; "
                f"they leave the factory at {self.factory_speed}",
            )
        if self.position_min_ticks >= self.position_max_ticks:
            raise FieldError(
                "position_max",
                f"the range is empty: position_min {self.position_min_ticks} is not below it",
                allowed=(f"{self.position_min_ticks + 1} to {TICKS_PER_TURN - 1}",),
                remedy="swap the two values, or widen the range",
            )
        return self

    @model_validator(mode="after")
    def _names_each_servo_once(self) -> Self:
        seen: set[int | None] = set()
        for index, joint in enumerate(self.joint):
            if joint.motor_id is not None and joint.motor_id not in self.motor_ids:
                raise FieldError(
                    f"joint[{index}].motor_id",
                    f"the bus has no servo {joint.motor_id}",
                    allowed=tuple(map(str, self.motor_ids)),
                    remedy="name one of motor_ids, or omit motor_id for every servo",
                )
            if joint.motor_id in seen:
                raise FieldError(
                    f"joint[{index}]",
                    "every servo has an entry already"
                    if joint.motor_id is None
                    else f"servo {joint.motor_id} has an entry already",
                    remedy="write all settings into one entry",
                )
            seen.add(joint.motor_id)
        return self

    @model_validator(mode="after")
    def _grips_below_the_overload(self) -> Self:
        for servo_id, joint in zip(self.motor_ids, self.joint_settings, strict=True):
            if not joint.grip_load_percent:
                continue
            if joint.grip_torque_percent is None or joint.grip_squeeze_rad is None:
                raise FieldError(
                    "joint",
                    f"servo {servo_id} has grip_load_percent, but lacks other settings of the grip mode",
                    remedy="add grip_torque_percent and grip_squeeze_rad, or gripper: true for the defaults",
                )
            limit = joint.torque_limit_percent or 100
            if joint.grip_torque_percent >= joint.overload[0] or joint.grip_torque_percent > limit:
                raise FieldError(
                    "joint",
                    f"servo {servo_id} would hold an object with {joint.grip_torque_percent:g} % torque, but "
                    f"its limit is {limit:g} % and it trips at {joint.overload[0]:g} %",
                    remedy="lower grip_torque_percent, or raise overload_torque_percent",
                )
        return self

    @model_validator(mode="after")
    def _fits_its_calibration(self) -> Self:
        if self.calibration is None:
            return self
        unknown = [servo_id for servo_id in self.motor_ids if self.calibration.motor(servo_id) is None]
        if unknown:
            raise FieldError(
                "motor_ids",
                f"the calibration of this arm has no motor {', '.join(map(str, unknown))}",
                allowed=tuple(str(motor.id) for motor in self.calibration.motors),
                remedy="calibrate the arm with all its motors, or correct motor_ids",
            )
        for servo_id, (low, high) in zip(self.motor_ids, self.ranges_ticks(), strict=True):
            if low >= high:
                motor = self.calibration.motor(servo_id)
                assert motor is not None
                raise FieldError(
                    "position_max",
                    f"the joint {motor.joint_name} cannot move: position_min {self.position_min_ticks} and "
                    f"position_max {self.position_max_ticks} exclude its whole calibrated range, "
                    f"{motor.range_min} to {motor.range_max}",
                    remedy="widen position_min and position_max. The calibrated range still limits the joint",
                )
        return self

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of motor_ids: the calibration's, else ``joint_<id>``."""
        motors = [self.calibration.motor(i) if self.calibration else None for i in self.motor_ids]
        return tuple(
            motor.joint_name if motor else f"joint_{servo_id}"
            for servo_id, motor in zip(self.motor_ids, motors, strict=True)
        )

    @property
    def joint_settings(self) -> tuple[ServoJoint, ...]:
        """Settings of each servo, in the order of motor_ids."""
        by_id = {joint.motor_id: joint for joint in self.joint}
        found = []
        for servo_id, name in zip(self.motor_ids, self.joint_names, strict=True):
            joint = by_id.get(servo_id, self.joint_type()).over(by_id.get(None))
            is_gripper = name == GRIPPER if joint.gripper is None else joint.gripper
            found.append(joint.of_gripper() if is_gripper else joint)
        return tuple(found)

    @property
    def are_grippers_unknown(self) -> bool:
        """Whether neither a calibration nor a joint block says which of several joints is a gripper."""
        if self.calibration is not None or len(self.motor_ids) == 1:
            return False
        return all(joint.gripper is None for joint in self.joint)

    def register_values(self) -> dict[int, dict[Register, int]]:
        """Register values for the settings of each servo, by id, only for servos with settings."""
        values = {}
        for index, (servo_id, joint) in enumerate(zip(self.motor_ids, self.joint_settings, strict=True)):
            row = {
                register: round(getattr(joint, name) * (steps or self.steps(name, index)))
                for name, (register, steps) in self.tuned.items()
                if getattr(joint, name) is not None
            }
            if row:
                values[servo_id] = row
        return values

    def steps(self, name: str, index: int) -> float:
        """Steps of a register per unit of a setting, if that depends on the servo."""
        raise NotImplementedError(f"{type(self).__name__} has no unit for {name} of servo {index}")

    @property
    def zero_ticks(self) -> float:
        """Position of zero radians: 2048 if calibrated, else the middle of the range."""
        if self.calibration is not None:
            return float(MIDDLE_TICK)
        return (self.position_min_ticks + self.position_max_ticks) / 2

    def speeds_ticks_s(self) -> list[float]:
        """Fastest move of each motor, in the order of motor_ids."""
        raise NotImplementedError(f"{type(self).__name__} has no speeds: override speeds_ticks_s")

    def inverted(self, servo_id: int) -> bool:
        """Whether a motor turns against its joint."""
        motor = self.calibration.motor(servo_id) if self.calibration else None
        return motor is not None and motor.inverted

    def ranges_ticks(self) -> list[tuple[int, int]]:
        """Range of each motor: the tightest of configuration and calibration."""
        ranges = []
        for servo_id in self.motor_ids:
            low, high = self.position_min_ticks, self.position_max_ticks
            motor = self.calibration.motor(servo_id) if self.calibration else None
            if motor is not None:
                low, high = max(low, motor.range_min), min(high, motor.range_max)
            ranges.append((low, high))
        return ranges

    def joints(self) -> tuple[JointRange, ...]:
        """All joints, known without a connection."""
        joints = []
        for servo_id, name, (low, high) in zip(
            self.motor_ids, self.joint_names, self.ranges_ticks(), strict=True
        ):
            ends = [ticks_to_rad(tick, zero_ticks=self.zero_ticks) for tick in (low, high)]
            if self.inverted(servo_id):
                ends = [-ends[1], -ends[0]]
            joints.append(JointRange(name, ends[0], ends[1]))
        return tuple(joints)
