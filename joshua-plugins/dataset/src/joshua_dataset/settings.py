"""Settings of the data store, from its block."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from joshua.api import BlockContext, BlockSettings, FieldError
from pydantic import model_validator

from joshua_dataset.cloud.address import Address, AddressError

#: LeRobot's names of robots, and how people write them: lower-case letters and digits only.
LEROBOT_ROBOTS = frozenset(
    {
        "so100",
        "so100follower",
        "so101",
        "so101follower",
        "soarm100",
        "soarm101",
        "koch",
        "kochv11",
        "kochfollower",
        "lekiwi",
        "omx",
        "omxfollower",
        "hopejr",
        "bisofollower",
        "biso100follower",
    }
)

FORMATS = {
    "FORMAT_HUGGINGFACE": "lerobot",
    "FORMAT_PARQUET": "parquet",
    "FORMAT_CSV": "csv",
    "FORMAT_JSONL": "jsonl",
    "FORMAT_MCAP": "mcap",
}
MISSING = {
    "MISSING_UNSPECIFIED": "drop",
    "MISSING_DROP": "drop",
    "MISSING_HOLD": "hold",
    "MISSING_FAIL": "fail",
}
CODECS = {"VIDEO_UNSPECIFIED": "h264", "VIDEO_H264": "h264", "VIDEO_HEVC": "hevc", "VIDEO_AV1": "av1"}
UNITS = {"UNIT_AUTO": "auto", "UNIT_LEROBOT": "lerobot", "UNIT_DEGREES": "deg", "UNIT_RADIANS": "rad"}
PICTURES = {
    "PICTURES_UNSPECIFIED": "video",
    "PICTURES_VIDEO": "video",
    "PICTURES_PNG": "png",
    "PICTURES_JPEG": "jpeg",
}
OPERATIONS = {
    "DATA_STORE_OPERATION_UNSPECIFIED": "record",
    "DATA_STORE_RECORD": "record",
    "DATA_STORE_UPLOAD": "upload",
    "DATA_STORE_REPLAY": "replay",
}
UPLOADS = {
    "UPLOAD_UNSPECIFIED": "at_end",
    "AFTER_EACH_EPISODE": "each",
    "AT_END": "at_end",
    "MANUAL": "manual",
}

#: Time that the upload at the end of a recording may take; a repeated Ctrl-C ends it.
UPLOAD_TIMEOUT_S = 7 * 24 * 3600.0

_STORAGE = "Set storage: STORAGE_CLOUD and remote_url"
_ADDRESS = 'Write an address such as remote_url: "hf://datasets/my-name/my-data"'


class StoreSettings(BlockSettings):
    """What is recorded, replayed or uploaded, and where it is stored.

    Attributes:
        folder: of the data set, absolute.
        operation, format, missing, codec, unit, pictures: values of the tables above.
        tasks: what the episodes show, in order; fps: frames per second; tolerance_s: 0 for the default.
        episode_duration_s: 0 for episodes that end when they are stopped; num_episodes: 0 for any number.
        episodes: to replay, () for all; speed: of a replay.
        buttons: of a gamepad, by what they do: ``record``, ``keep`` or ``discard``.
        is_cloud: whether there is a remote copy; remote: its address; upload: when a recording is sent there.
    """

    folder: str
    operation: Literal["record", "replay", "upload"] = "record"
    format: str = "lerobot"
    tasks: tuple[str, ...] = ("",)
    fps: int = 30
    tolerance_s: float = 0.0
    missing: Literal["drop", "hold", "fail"] = "drop"
    codec: str = "h264"
    unit: Literal["auto", "lerobot", "deg", "rad"] = "auto"
    pictures: str = "video"
    resume: bool = False
    episode_duration_s: float = 0.0
    reset_duration_s: float = 10.0
    warmup_s: float = 0.0
    num_episodes: int = 0
    auto_start: bool = False
    episodes: tuple[int, ...] = ()
    speed: float = 1.0
    buttons: dict[str, str] = {}  # noqa: RUF012 (pydantic copies it)
    spoken_cues: bool = False
    is_cloud: bool = False
    remote: str = ""
    upload: Literal["each", "at_end", "manual"] = "manual"

    @property
    def stop_timeout_s(self) -> float:
        """Time that the node may take to stop; 0 for the default."""
        return UPLOAD_TIMEOUT_S if self.operation == "record" and self.upload != "manual" else 0.0

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """See ``BlockSettings``."""
        plain = {
            name: values[name]
            for name in (
                "fps",
                "tolerance_s",
                "resume",
                "episode_duration_s",
                "reset_duration_s",
                "warmup_s",
                "num_episodes",
                "auto_start",
                "speed",
                "spoken_cues",
            )
            if values.get(name) is not None
        }
        first = values.get("task") or values.get("dataset_name") or ""
        path = os.path.expanduser(values.get("local_path") or "")  # noqa: PTH111 (as the checks)
        is_cloud = values.get("storage") == "STORAGE_CLOUD"
        return {
            **plain,
            "folder": str(Path(context.folder or ".") / path) if path else "",
            "operation": OPERATIONS.get(str(values.get("operation")), "record"),
            "format": FORMATS.get(str(values.get("format")), "lerobot"),
            "missing": MISSING.get(str(values.get("missing")), "drop"),
            "codec": CODECS.get(str(values.get("video_codec")), "h264"),
            "unit": UNITS.get(str(values.get("units")), "auto"),
            "pictures": PICTURES.get(str(values.get("pictures")), "video"),
            "buttons": {
                name: values[f"{name}_button"]
                for name in ("record", "keep", "discard")
                if values.get(f"{name}_button")
            },
            "tasks": (first, *(values.get("more_tasks") or ())),
            "episodes": tuple(values.get("episodes") or ()),
            "is_cloud": is_cloud,
            "remote": str(values.get("remote_url") or "") if is_cloud else "",
            "upload": UPLOADS.get(str(values.get("upload")), "at_end") if is_cloud else "manual",
        }

    @model_validator(mode="after")
    def _fits(self) -> StoreSettings:
        if self.format == "lerobot" and self.pictures != "video":
            raise FieldError(
                "pictures",
                "LeRobot's layout stores the pictures of a camera as a video",
                allowed=("PICTURES_VIDEO",),
                remedy="Remove pictures, or set format: FORMAT_PARQUET",
            )
        twice = [name for name in self.buttons.values() if list(self.buttons.values()).count(name) > 1]
        if twice:
            raise FieldError(
                f"{list(self.buttons)[-1]}_button",
                f"the button {twice[0]!r} has two functions",
                remedy="Name another button",
            )
        return self

    @model_validator(mode="after")
    def _reaches_its_remote(self) -> StoreSettings:
        if not self.is_cloud:
            if self.operation == "upload":
                raise FieldError(
                    "storage", "an upload goes to a remote", allowed=("STORAGE_CLOUD",), remedy=_STORAGE
                )
            return self
        if self.remote:
            try:
                Address.parse(self.remote)
            except AddressError as error:
                message = f"remote_url cannot be used: {error}"
                raise FieldError(
                    "remote_url", message, allowed=error.allowed, remedy=error.remedy or _ADDRESS
                ) from None
        elif self.operation != "upload":  # the check of the mode asks for it
            raise FieldError("remote_url", "STORAGE_CLOUD requires remote_url, the address", remedy=_ADDRESS)
        if not self.folder and self.operation == "record":
            raise FieldError(
                "local_path",
                "a recording is written to this machine before it is uploaded, and needs local_path",
                remedy='Add local_path: "datasets/my_data"',
            )
        if not self.folder and self.operation == "replay":
            raise FieldError(
                "local_path",
                "a replay reads the data set from this machine, and needs local_path",
                remedy=f"Run `joshua dataset download {self.remote or 'URL'} datasets/my_data`, "
                'and add local_path: "datasets/my_data"',
            )
        return self

    def joint_unit(self, robot_type: str) -> str:
        """Return the unit of joint positions in the data set: ``rad``, ``deg`` or ``lerobot``."""
        if self.unit != "auto":
            return self.unit
        plain = re.sub(r"[^a-z0-9]", "", robot_type.lower())
        return "lerobot" if plain in LEROBOT_ROBOTS else "rad"
