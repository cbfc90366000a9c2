"""Context for the settings of a block beside the block itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.plan.joints import JointRange

if TYPE_CHECKING:
    from joshua.plugins.model_settings import ModelContext
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
class BlockContext:
    """The context of a block from the rest of the file.

    Attributes:
        calibration: of the node's device; None if it has none.
        joints: those that a sensor commands; () if not all are known.
        simulation: settings of the simulation of the device; None for a real device.
        folder: to which paths of a service are relative; data_store: beside a simulator or trainer.
        model: the entry of a model; None for other blocks.
        launch: nodes will be started.
    """

    calibration: ArmCalibration | None = None
    joints: tuple[JointRange, ...] = ()
    simulation: dict[str, Any] | None = None
    folder: str = ""
    data_store: DataStoreContext = DataStoreContext()
    model: ModelContext | None = None
    launch: bool = False
