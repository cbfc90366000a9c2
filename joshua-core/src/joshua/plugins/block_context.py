"""What decides the settings of a block beside the block itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from joshua.plan.joints import JointRange
from joshua.plan.model_needs import Compute

if TYPE_CHECKING:
    from joshua.schema.calibration_pb2 import ArmCalibration


@dataclass(frozen=True, eq=False, repr=False)
class DataStoreContext:
    """The data set that a simulator replays or makes.

    Attributes:
        writer: import string of the ``EpisodeWriter``, "" for none; episodes: to replay, () for all.
    """

    writer: str = ""
    task: str = ""
    robot_type: str = ""
    path: str = ""
    episodes: tuple[int, ...] = ()
    format: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class ModelContext:
    """What the entry of a model says beside its settings block.

    Attributes:
        weights: folder, file or hub id; "" for none. Local paths are absolute.
        task: of the file; compute: of the file. rate_hz: of the actions that the node publishes.
    """

    weights: str = ""
    task: str = ""
    compute: Compute = field(default_factory=Compute)
    rate_hz: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class BlockContext:
    """What the rest of the file says to a block.

    Attributes:
        calibration: of the node's device; None where it has none.
        joints: that a sensor's commands reach; () where not all of them are known.
        simulation: settings of the simulation that a device is part of; None for any other.
        folder: at which relative paths of a service start; data_store: beside a simulator.
        model: of the entry of a model.
        launch: nodes are about to be started.
    """

    calibration: ArmCalibration | None = None
    joints: tuple[JointRange, ...] = ()
    simulation: dict[str, Any] | None = None
    folder: str = ""
    data_store: DataStoreContext = DataStoreContext()
    model: ModelContext = ModelContext()
    launch: bool = False
