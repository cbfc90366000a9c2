"""The contracts of ``--emulate`` and ``--sim``, which replace devices by emulators or physics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from google.protobuf.message import Message

from joshua.schema.calibration_pb2 import ArmCalibration


class EmulationError(Exception):
    """An emulator cannot start. The message says why and what to do."""


class FaultRefusedError(EmulationError):
    """An emulator does not support a fault, or this value of it. The message lists what is allowed."""


@dataclass(frozen=True)
class PhysicsLink:
    """The simulated arm that moves the joints of an emulated actuator (``--emulate --sim``).

    Attributes:
        actuators: of the model, in joint order; start_rad: initial positions, relative to the middle of the
            ranges.
        socket: path of the UNIX socket (SOCK_SEQPACKET) of the physics, once the simulation runs.
    """

    actuators: tuple[str, ...]
    start_rad: tuple[float, ...]
    socket: Path = Path()


@dataclass(frozen=True)
class PhysicsCamera:
    """The camera of the model that renders the pictures of an emulated one (``--emulate --sim``)."""

    camera: str
    socket: Path = Path()


#: Coupling of an emulated device.
Coupling = PhysicsLink | PhysicsCamera


@dataclass(frozen=True)
class EmulatedDevice:
    """The device that an emulator replaces.

    Attributes:
        node_name: name of its node; role: its enum value, such as ``ACTION_LEADER``.
        block: its configuration block.
        state_folder: for the persistent memory of the device.
        faults: faults to inject, in the emulator's syntax, such as ``drop=0.01``.
        physics: the simulation that moves the joints or renders the pictures; None leaves that to the
            emulator.
    """

    node_name: str
    role: str
    block: Message
    state_folder: Path
    faults: tuple[str, ...] = ()
    physics: Coupling | None = None


class DeviceEmulator(ABC):
    """Emulates one device in a separate process, which ends with its parent.

    Attributes:
        couples: it supports ``EmulatedDevice.physics``, so it can be part of a simulation.
    """

    couples: ClassVar[bool] = False

    def __init__(self, device: EmulatedDevice) -> None:
        self.device = device

    @abstractmethod
    def start(self) -> None:
        """Starts the process and waits until it is ready. Raises EmulationError, FaultRefusedError."""

    @abstractmethod
    def amend(self, block: Message) -> None:
        """Replaces the device's endpoint by the emulator's, and changes nothing else.

        Before ``start``, for a plan that is only shown, the endpoint is ``emulated``.
        """

    @property
    @abstractmethod
    def endpoint(self) -> str:
        """The address of the emulator, for people."""

    def calibration(self) -> ArmCalibration | None:
        """The calibration of the emulated device; None if it has none."""
        return None

    def guide(self, joint: int | None, seconds: float) -> bool:
        """Moves the joints as a calibration asks a person to. Returns False if not supported.

        Args:
            joint: index of the joint that moves to one end, to the other and back to the middle; the others
                stay. None moves all joints to their middles.
            seconds: of the motion. The call returns immediately.
        """
        del joint, seconds
        return False

    @abstractmethod
    def close(self) -> None:
        """Ends the process. Idempotent."""


class SimAdapterError(Exception):
    """The simulation cannot replace a device. The message says which, why and what to do."""


@dataclass(frozen=True)
class RealDevice:
    """A device to be simulated.

    Attributes:
        node_name: name of its node; role: its enum value, such as ``ACTION_LEADER``.
        owner: the ``SingleAction`` or ``SinglePerception`` message. The simulator replaces its block.
        block_name: member of the oneof with the block.
        joints: names of an actuator's joints from a calibration, else ``joint_<id>``; () for a camera.
        in_chain: its motors form a chain as on a servo bus, so the model's motors are assigned in order,
            whatever their names.
    """

    node_name: str
    role: str
    owner: Any
    block_name: str
    joints: tuple[str, ...] = ()
    in_chain: bool = False


#: Type of ``SimulatorSpec.sim_adapter``. Its arguments are the configuration, which it changes, the devices
#: to replace, and whether their buses are emulated. It replaces their blocks by simulated ones, and returns
#: the coupling of each emulated device by node name. Raises SimAdapterError.
SimAdapter = Callable[[Any, Sequence[RealDevice], bool], dict[str, Coupling]]
