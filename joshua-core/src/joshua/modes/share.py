"""What of a file each operation mode starts, and which service blocks it needs or can do without."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from joshua.schema import config_pb2 as pb


class Need(Enum):
    """How much a mode needs the plugin behind a service block."""

    REQUIRED = "required"
    OPTIONAL = "optional"


@dataclass(frozen=True)
class ModeShare:
    """What one mode starts.

    Attributes:
        devices: actuators and sensors; models: the nodes of ``ai.models``.
        services: blocks run by a service node (``data_store``, ``training``, ``simulation``).
    """

    devices: bool = True
    models: bool = False
    services: dict[str, Need] = field(default_factory=dict)


_SHARES: dict[int, ModeShare] = {
    pb.MODE_TELEOPERATE: ModeShare(services={"data_store": Need.OPTIONAL, "simulation": Need.OPTIONAL}),
    pb.MODE_INFERENCE: ModeShare(
        models=True, services={"data_store": Need.OPTIONAL, "simulation": Need.OPTIONAL}
    ),
    pb.MODE_TRAINING: ModeShare(devices=False, services={"training": Need.REQUIRED}),
    pb.MODE_CALIBRATION: ModeShare(services={"simulation": Need.OPTIONAL}),
    pb.MODE_TEST: ModeShare(models=True, services={"simulation": Need.OPTIONAL}),
    pb.MODE_DATA_STORE: ModeShare(services={"data_store": Need.REQUIRED, "simulation": Need.OPTIONAL}),
    pb.MODE_SIMULATION: ModeShare(services={"simulation": Need.REQUIRED, "data_store": Need.OPTIONAL}),
}


def mode_share(config: pb.Config) -> ModeShare:
    """Names what the file's mode starts; an unset or unknown mode starts every device."""
    mode = config.general.mode
    share = _SHARES.get(mode, ModeShare())
    if mode == pb.MODE_TRAINING and config.ai.training.environment == pb.ENV_REAL:
        return ModeShare(devices=True, services=share.services)
    if mode == pb.MODE_DATA_STORE and config.ai.data_store.operation == pb.DATA_STORE_UPLOAD:
        return ModeShare(devices=False, services={"data_store": Need.REQUIRED})
    return share
