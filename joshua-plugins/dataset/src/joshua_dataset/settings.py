"""Settings of the data store, from its block."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from joshua.api import BlockContext, BlockSettings, FieldError
from pydantic import model_validator

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


class StoreSettings(BlockSettings):
    """What is recorded, replayed or uploaded, and where it stands.

    Attributes:
        folder: of the data set, absolute.
        operation, format, missing, codec, unit, pictures: values of the tables above.
        tasks: what the episodes show, in order; fps: frames per second; tolerance_s: 0 for the default.
        episode_duration_s: 0 for episodes that end when they are stopped; num_episodes: 0 for any number.
        episodes: to replay, () for all; speed: of a replay.
        buttons: of a gamepad, by what they do: ``record``, ``keep`` or ``discard``.
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
        }

    @model_validator(mode="after")
    def _fits(self) -> StoreSettings:
        if self.format == "lerobot" and self.pictures != "video":
            raise FieldError(
                "pictures",
                "LeRobot's layout keeps the pictures of a camera as a video",
                allowed=("PICTURES_VIDEO",),
                remedy="Remove pictures, or set format: FORMAT_PARQUET",
            )
        twice = [name for name in self.buttons.values() if list(self.buttons.values()).count(name) > 1]
        if twice:
            raise FieldError(
                f"{list(self.buttons)[-1]}_button",
                f"the button {twice[0]!r} has two meanings",
                remedy="Name another button",
            )
        return self

    def joint_unit(self, robot_type: str) -> str:
        """Unit of joint positions in the data set: ``rad``, ``deg`` or ``lerobot``."""
        if self.unit != "auto":
            return self.unit
        plain = re.sub(r"[^a-z0-9]", "", robot_type.lower())
        return "lerobot" if plain in LEROBOT_ROBOTS else "rad"
