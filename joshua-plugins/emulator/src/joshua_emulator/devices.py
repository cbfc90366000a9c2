"""The emulators that ``--emulate`` substitutes for the devices of a file."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from google.protobuf.message import Message
from joshua.api.emulation import (
    DeviceEmulator,
    EmulatedDevice,
    EmulationError,
    FaultRefusedError,
    PhysicsCamera,
    PhysicsLink,
)
from joshua.api.schema import calibration_pb2

from joshua_emulator.camera.process import EmulatedCamera
from joshua_emulator.emulator_process import EmulatorError, EmulatorProcess, FaultRefused
from joshua_emulator.process import EmulatedBus
from joshua_emulator.spike.process import EmulatedHub

if TYPE_CHECKING:
    from pathlib import Path

#: Motion of a leader's joints in place of the user.
LEADER_MOTION = "sine"


class Unstarted:
    """Endpoints of a device that is only shown in a plan."""

    port = by_id = adapter = device = "emulated"
    source = "http://emulated"

    def close(self) -> None:
        """Do nothing: no process runs."""


class ProcessEmulator(DeviceEmulator):
    """An emulator that runs as a process of this distribution."""

    def __init__(self, device: EmulatedDevice) -> None:
        super().__init__(device)
        self._process: Any = Unstarted()

    def start(self) -> None:
        """Start the process. Raises EmulationError, FaultRefusedError."""
        folder = self.device.state_folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise EmulationError(
                f"{self.device.node_name}: {folder}, which keeps the memory of the emulated device, cannot "
                f"be created: {error.strerror}. Set XDG_STATE_HOME to a writable folder"
            ) from error
        try:
            self._process = self.make_process(self.device.block, folder)
            self._process.start()
        except FaultRefused as error:
            raise FaultRefusedError(f"--fault {self.device.node_name}: {error}") from error
        except (EmulatorError, OSError) as error:
            raise EmulationError(f"{self.device.node_name}: {error}") from error

    @abstractmethod
    def make_process(self, block: Any, folder: Path) -> EmulatorProcess:
        """Return the emulator process for a block."""

    def close(self) -> None:
        """End the process."""
        self._process.close()


class ServoBusEmulator(ProcessEmulator):
    """An STS3215 bus; six servos are an SO-ARM100, already calibrated."""

    couples = True

    #: Subcommand of the emulator's command line, and the arm that six servos are.
    protocol: ClassVar[str] = "feetech"
    arm: ClassVar[str] = "so_arm100"
    #: Servos of another family at the same node have their own store.
    eeprom_file: ClassVar[str] = "eeprom.json"

    def make_process(self, block: Any, folder: Path) -> EmulatedBus:
        """Return a bus with the ids and the line speed of the block."""
        ids = list(block.motor_ids)
        is_arm = len(ids) == 6
        return EmulatedBus(
            self.protocol,
            ids=ids,
            identity=self.device.node_name,
            baudrate=block.comm.serial.baudrate or 1_000_000,
            eeprom=folder / self.eeprom_file,
            arm=self.arm if is_arm else None,
            calibrated=is_arm,
            motion=LEADER_MOTION if self.device.role == "ACTION_LEADER" else None,
            fault=list(self.device.faults),
            **self.family_options(block),
            **self.physics_options(),
        )

    def physics_options(self) -> dict[str, Any]:
        """Options of the command line for joints that a simulation moves."""
        link = self.device.physics
        if not isinstance(link, PhysicsLink):
            return {}
        return {
            "physics": link.socket,
            "physics_actuators": link.actuators,
            "physics_start_rad": link.start_rad,
        }

    def family_options(self, block: Any) -> dict[str, Any]:
        """Further options of the command line."""
        del block
        return {}

    def amend(self, block: Message) -> None:
        """Replace the serial port with the pseudo-terminal."""
        serial: Any = block.comm.serial  # type: ignore[attr-defined]
        for field in ("serial_number", "vid_pid"):
            serial.ClearField(field)
        serial.port = self._process.by_id

    @property
    def endpoint(self) -> str:
        """Path of the pseudo-terminal."""
        return str(self._process.port)

    def calibration(self) -> calibration_pb2.ArmCalibration | None:
        """Return the content of the servos' EEPROM."""
        if len(self.device.block.motor_ids) != 6:  # type: ignore[attr-defined]
            return None
        values = self._process.calibration()
        motors = [calibration_pb2.MotorCalibration(**motor) for motor in values.pop("motors")]
        return calibration_pb2.ArmCalibration(motors=motors, **values)

    def guide(self, joint: int | None, seconds: float) -> bool:
        """Move the joints in place of the user."""
        self._process.guide(joint, seconds)
        return True


class DynamixelBusEmulator(ServoBusEmulator):
    """A bus of X-series servos; six servos are a Koch arm, already calibrated."""

    protocol = "dynamixel"
    arm = "koch"
    eeprom_file = "eeprom-dynamixel.json"

    def family_options(self, block: Any) -> dict[str, Any]:
        """The models of the block."""
        return {"models": list(block.models)}


class CameraEmulator(ProcessEmulator):
    """A camera that serves Motion JPEG on loopback: a test scene, or a camera of the simulation."""

    couples = True

    def make_process(self, block: Any, folder: Path) -> EmulatedCamera:
        """Make the camera with the size and the rate of the block."""
        del folder  # a camera stores nothing
        options: dict[str, Any] = {}
        if isinstance(link := self.device.physics, PhysicsCamera):
            options = {"physics": link.socket, "physics_camera": link.camera}
        return EmulatedCamera(block.width, block.height, block.fps, fault=list(self.device.faults), **options)

    def amend(self, block: Message) -> None:
        """Replace the device with the address of the stream."""
        block.ClearField("device_id")
        block.source = self._process.source  # type: ignore[attr-defined]

    @property
    def endpoint(self) -> str:
        """Address of the stream."""
        return str(self._process.source)


class HubEmulator(ProcessEmulator):
    """A LEGO SPIKE hub with Pybricks, over virtual Bluetooth."""

    def make_process(self, block: Any, folder: Path) -> EmulatedHub:
        """Make the hub with the name and the ports of the block."""
        del folder  # a hub's program is uploaded again after each power cycle
        return EmulatedHub(
            list(block.port_names),
            name=block.comm.ble.device_name,
            motion=LEADER_MOTION if self.device.role == "ACTION_LEADER" else None,
            fault=list(self.device.faults),
        )

    def amend(self, block: Message) -> None:
        """Replace the system's adapter with the virtual one."""
        block.comm.ble.adapter = self._process.adapter  # type: ignore[attr-defined]

    @property
    def endpoint(self) -> str:
        """Adapter through which the hub is reached."""
        return str(self._process.adapter)

    def guide(self, joint: int | None, seconds: float) -> bool:
        """Move the shafts in place of the user."""
        self._process.guide(joint, seconds)
        return True

    def calibration(self) -> calibration_pb2.ArmCalibration:
        """Return a calibration: zero at the initial angle, and a quarter of a turn to both sides."""
        motors = []
        for port, motor in self._process.state()["motors"].items():
            raw = round(motor["absolute_deg"] % 360 * 4096 / 360) % 4096
            motors.append(
                calibration_pb2.MotorCalibration(
                    id="ABCDEF".index(port) + 1,
                    joint_name=f"joint_{port.lower()}",
                    homing_offset=max(raw - 2048, -2047),
                    range_min=1024,
                    range_max=3072,
                )
            )
        return calibration_pb2.ArmCalibration(motors=motors)
