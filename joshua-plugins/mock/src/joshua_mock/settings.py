"""Settings of the mock devices, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from joshua.api import ActuatorSettings, BlockContext, BlockSettings, FieldError, FromField, JointRange
from joshua.api.calibration import ticks_to_rad
from pydantic import model_validator

if TYPE_CHECKING:  # child processes get plain values and need no protobuf
    from google.protobuf.message import Message
    from joshua.api.schema import calibration_pb2

_MOTIONS = {"MOCK_MOTION_NONE": "none", "MOCK_MOTION_SINE": "sine", "MOCK_MOTION_FILE": "file"}


def _motion(name: str) -> str:
    return _MOTIONS.get(name, name)


def _require_order(low: float, high: float, what: str, why: str) -> None:
    if not low < high:
        raise FieldError(
            f"{what}_max",
            f"{what}_max is not above {what}_min: {why}",
            allowed=(f"more than {what}_min",),
            remedy=f"set {what}_max above {what}_min",
        )


class MockMotorSettings(ActuatorSettings):
    """Settings of a group of virtual motors.

    Attributes:
        num_motors: number of motors.
        position_min_rad, position_max_rad: range that the block allows to every motor.
        motion: of motors without torque: none, sine, or file.
        motion_amplitude_rad, motion_frequency_hz: of the sine.
        motion_file: CSV file to replay; "" for none.
        time_constant_s: of the first-order motion towards the goal.
        joint_ranges: one entry for each motor; the tightest of block and calibration.
    """

    num_motors: int
    position_min_rad: Annotated[float, FromField("position_min", ticks_to_rad)]
    position_max_rad: Annotated[float, FromField("position_max", ticks_to_rad)]
    motion: Annotated[Literal["none", "sine", "file"], FromField("motion", _motion)]
    motion_amplitude_rad: float
    motion_frequency_hz: float
    motion_file: str
    time_constant_s: float
    joint_ranges: tuple[JointRange, ...] = ()

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the joints, named and narrowed by the calibration if there is one."""
        result = super().si_values(values, node, context)
        low, high = result["position_min_rad"], result["position_max_rad"]
        calibrated = {motor.id: motor for motor in context.calibration.motors} if context.calibration else {}
        result["joint_ranges"] = [
            _joint_range(number, calibrated.get(number), low, high)
            for number in range(1, values["num_motors"] + 1)
        ]
        return result

    @model_validator(mode="after")
    def _check_range(self) -> MockMotorSettings:
        _require_order(self.position_min_rad, self.position_max_rad, "position", "the motors have no range")
        for joint in self.joint_ranges:
            if not joint.min_rad < joint.max_rad:
                raise FieldError(
                    "position_max",
                    f"the calibrated range of {joint.name} lies outside position_min to position_max",
                    remedy="widen position_min and position_max, or calibrate again",
                )
        if self.motion == "file" and not self.motion_file:
            raise FieldError(
                "motion_file",
                "motion is MOCK_MOTION_FILE, but motion_file is empty",
                remedy="name a CSV file in motion_file, or choose another motion",
            )
        return self

    def joints(self) -> tuple[JointRange, ...]:
        """Joints, known without a connection."""
        return self.joint_ranges


def _joint_range(
    number: int, calibrated: calibration_pb2.MotorCalibration | None, low_rad: float, high_rad: float
) -> JointRange:
    if calibrated is None:
        return JointRange(f"joint_{number}", low_rad, high_rad)
    return JointRange(
        calibrated.joint_name or f"joint_{number}",
        max(low_rad, ticks_to_rad(calibrated.range_min)),
        min(high_rad, ticks_to_rad(calibrated.range_max)),
    )


class MockCameraSettings(BlockSettings):
    """Settings of a virtual camera: size in pixels, frames per second."""

    width: int
    height: int
    fps: int


def _sample_rate_hz(node: Message | None, otherwise_hz: float) -> float:
    """Return the sample rate of a virtual sensor: that of its fastest publisher."""
    rates = [publisher.publish_rate_hz for publisher in getattr(node, "publishers", ())]
    return max((rate for rate in rates if rate > 0), default=otherwise_hz)


class MockEncoderSettings(BlockSettings):
    """Settings of a virtual encoder.

    Attributes:
        resolution: ticks in one revolution.
        speed_rad_s: speed of the shaft.
        inverted: whether to count in the opposite direction.
        sample_rate_hz: rate of its readings, that of the node's fastest publisher.
    """

    resolution: int
    speed_rad_s: float
    inverted: bool
    sample_rate_hz: float = 100.0

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the sample rate."""
        return super().si_values(values, node, context) | {"sample_rate_hz": _sample_rate_hz(node, 100.0)}


class MockLidarSettings(BlockSettings):
    """Settings of a virtual laser scanner in the middle of a rectangular room.

    Attributes:
        angle_min_rad, angle_max_rad: first and last beam, counter-clockwise positive (REP 103).
        range_min_m, range_max_m: distances that count as measurements.
        num_beams: beams of one scan.
        room_length_m, room_width_m: size of the room along x and y.
        scan_rate_hz: scans per second, the rate of the node's fastest publisher.
    """

    angle_min_rad: Annotated[float, FromField("angle_min")]
    angle_max_rad: Annotated[float, FromField("angle_max")]
    range_min_m: Annotated[float, FromField("range_min")]
    range_max_m: Annotated[float, FromField("range_max")]
    num_beams: int
    room_length_m: float
    room_width_m: float
    scan_rate_hz: float = 10.0

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the scan rate."""
        return super().si_values(values, node, context) | {"scan_rate_hz": _sample_rate_hz(node, 10.0)}

    @model_validator(mode="after")
    def _check_spans(self) -> MockLidarSettings:
        _require_order(self.angle_min_rad, self.angle_max_rad, "angle", "the scan has no width")
        _require_order(self.range_min_m, self.range_max_m, "range", "nothing can be measured")
        return self
