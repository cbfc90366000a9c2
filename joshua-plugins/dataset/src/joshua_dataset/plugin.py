"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.plugins.hooks import hookimpl
from joshua.plugins.provision import Provision, ProvisionKind


@hookimpl
def joshua_provisions() -> list[Provision]:
    """Names the writer of data sets."""
    return [
        Provision(
            kind=ProvisionKind.EPISODE_WRITER,
            block="data_store",
            enum_values=("FORMAT_HUGGINGFACE",),
            implementation="joshua_dataset.lerobot_writer:LeRobotWriter",
            summary="data sets in the layout of LeRobot v3",
        ),
    ]
