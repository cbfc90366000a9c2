"""The contracts of ``--emulate`` and ``--sim``: what stands for one device, by its protocol or as physics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from google.protobuf.message import Message

from joshua.schema.calibration_pb2 import ArmCalibration


class EmulationError(Exception):
    """An emulator cannot start; the message says why and what to do."""


class FaultRefusedError(EmulationError):
    """An emulator does not know a fault, or not with this value; the message lists what is allowed."""


@dataclass(frozen=True)
class PhysicsLink:
    """The simulated arm that moves the joints of an emulated actuator (``--emulate --sim``).

    Attributes:
        actuators: of the model, in joint order; start_rad: where its joints are at first, about the middle
            of their ranges.
        socket: path of the UNIX socket (SOCK_SEQPACKET) where the physics answers, once the simulation runs.
    """

    actuators: tuple[str, ...]
    start_rad: tuple[float, ...]
    socket: Path = Path()


@dataclass(frozen=True)
class PhysicsCamera:
    """The simulated camera, one of the model, that draws what an emulated one sees (``--emulate --sim``)."""

    camera: str
    socket: Path = Path()


#: What an emulated device is joined to.
Coupling = PhysicsLink | PhysicsCamera


@dataclass(frozen=True)
class EmulatedDevice:
    """The device that an emulator stands for.

    Attributes:
        node_name: name of the node that drives it; role: its enum value, such as ``ACTION_LEADER``.
        block: its configuration block.
        state_folder: where what a real device would remember is kept from run to run.
        faults: faults to bring about, each in the emulator's own words, such as ``drop=0.01``.
        physics: what moves the joints of an actuator or draws the pictures of a camera; None leaves that to
            the emulator.
    """

    node_name: str
    role: str
    block: Message
    state_folder: Path
    faults: tuple[str, ...] = ()
    physics: Coupling | None = None


class DeviceEmulator(ABC):
    """Stands for one device in a process of its own, which ends with the one that started it.

    Attributes:
        couples: it acts on ``EmulatedDevice.physics``, so that it can be part of a simulation.
    """

    couples: ClassVar[bool] = False

    def __init__(self, device: EmulatedDevice) -> None:
        self.device = device

    @abstractmethod
    def start(self) -> None:
        """Starts the process and waits until it answers. Raises EmulationError, FaultRefusedError."""

    @abstractmethod
    def amend(self, block: Message) -> None:
        """Puts the emulator's endpoint in place of the device's; changes nothing else.

        Before ``start``, a plan that only shows the endpoint asks for a word in its place: ``emulated``.
        """

    @property
    @abstractmethod
    def endpoint(self) -> str:
        """Where the emulator is reached, for people."""

    def calibration(self) -> ArmCalibration | None:
        """The calibration that the emulated device holds; None where it has none."""
        return None

    def guide(self, joint: int | None, seconds: float) -> bool:
        """Moves the device's joints as a calibration asks a person to; returns False where it cannot.

        Args:
            joint: place of the joint that goes from where it is to one end, to the other and back to the
                middle, while the others stay; None moves all joints to their middles.
            seconds: that it takes; the call returns at once.
        """
        del joint, seconds
        return False

    @abstractmethod
    def close(self) -> None:
        """Ends the process; a second call does nothing."""


class SimAdapterError(Exception):
    """The simulation cannot stand for a device; the message says which, why and what to do."""


@dataclass(frozen=True)
class RealDevice:
    """A device that the simulation is to stand for.

    Attributes:
        node_name: name of its node; role: its enum value, such as ``ACTION_LEADER``.
        owner: the ``SingleAction`` or ``SinglePerception`` message; the simulator replaces its block.
        block_name: member of the oneof that holds the block.
        joints: names of an actuator's joints where a calibration gives them, else ``joint_<id>``; () for a
            camera.
        in_chain: its motors follow one another as on a servo bus, so that those of the model stand for them
            in order, whatever they are called.
    """

    node_name: str
    role: str
    owner: Any
    block_name: str
    joints: tuple[str, ...] = ()
    in_chain: bool = False


#: What ``SimulatorSpec.sim_adapter`` names. It takes the configuration, which it changes, the devices to
#: stand for and whether their buses are emulated, puts blocks of simulated devices in their place, and
#: returns what each emulated device is coupled to by node name. Raises SimAdapterError.
SimAdapter = Callable[[Any, Sequence[RealDevice], bool], dict[str, Coupling]]
