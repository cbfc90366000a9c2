"""The contract of ``--sim``: a simulator's devices in place of the real ones of a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


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


@dataclass(frozen=True)
class CoupledArm:
    """An arm whose bus is emulated and whose joints the simulation moves: fields of ``PhysicsLink``."""

    actuators: tuple[str, ...]
    start_rad: tuple[float, ...]


@dataclass(frozen=True)
class CoupledCamera:
    """A camera that is emulated and whose pictures the simulation draws; ``camera`` is one of the model."""

    camera: str


#: What ``SimulatorSpec.sim_adapter`` names. It takes the configuration, which it changes, the devices to
#: stand for and whether their buses are emulated, puts blocks of simulated devices in their place, and
#: returns what each emulated device is coupled to by node name. Raises SimAdapterError.
SimAdapter = Callable[[Any, Sequence[RealDevice], bool], dict[str, CoupledArm | CoupledCamera]]
