"""Context for the settings of a block beside the block itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from joshua.plan.joints import JointRange
from joshua.plan.model_needs import Compute

if TYPE_CHECKING:
    from joshua.schema.calibration_pb2 import ArmCalibration


@dataclass(frozen=True, eq=False, repr=False)
class DataStoreContext:
    """The data set that a simulator replays or generates, or that a trainer learns from.

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
    """The entry of a model beside its settings block.

    Attributes:
        weights: folder, file or hub id; "" for none. Local paths are absolute.
        task: of the file; compute: of the file. rate_hz: of the node's published actions.
    """

    weights: str = ""
    task: str = ""
    compute: Compute = field(default_factory=Compute)
    rate_hz: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class BlockContext:
    """The context of a block from the rest of the file.

    Attributes:
        calibration: of the node's device; None if it has none.
        joints: those that a sensor commands; () if not all are known.
        simulation: settings of the simulation of the device; None for a real device.
        folder: to which paths of a service are relative; data_store: beside a simulator or trainer.
        model: of the entry of a model.
        launch: nodes will be started.
    """

    calibration: ArmCalibration | None = None
    joints: tuple[JointRange, ...] = ()
    simulation: dict[str, Any] | None = None
    folder: str = ""
    data_store: DataStoreContext = DataStoreContext()
    model: ModelContext = ModelContext()
    launch: bool = False
