"""Makes LeRobot importable beside a torch without CUDA, and lets it decode videos with PyAV.

PyPI's torchvision expects operators that a CPU build of torch does not have. They are declared here and
never called. LeRobot's writer relies on ``float`` of an array of shape (1,), which newer releases of numpy
refuse.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import datasets
import numpy as np
import torch

_OPERATORS = torch.library.Library("torchvision", "DEF")
for _name in ("nms", "qnms"):
    _OPERATORS.define(f"{_name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")


def decode(path: Path, timestamps: list[float], tolerance_s: float, backend: str | None = None) -> Any:
    """Frames of a video at some times, (N, 3, H, W) in [0, 1], as LeRobot's own decoders return them."""
    del backend
    found: dict[int, Any] = {}
    least, most = min(timestamps), max(timestamps)
    with av.open(str(path)) as container:
        stream: Any = container.streams.video[0]
        container.seek(int(max(0.0, least - tolerance_s) / stream.time_base), stream=stream)
        for picture in container.decode(stream):
            for number, wanted in enumerate(timestamps):
                if abs(picture.time - wanted) <= tolerance_s and number not in found:
                    found[number] = picture.to_ndarray(format="rgb24")
            if picture.time > most + tolerance_s:
                break
    assert len(found) == len(timestamps), f"{path} has no frame at some of {timestamps}"
    stacked = np.stack([found[number] for number in range(len(timestamps))])
    return torch.from_numpy(stacked).permute(0, 3, 1, 2).float() / 255


_encode = datasets.Value.encode_example


def _encoded(self: datasets.Value, value: Any) -> Any:
    return _encode(self, value.item() if isinstance(value, np.ndarray) else value)


def lerobot_dataset() -> Any:
    """LeRobot's class of data sets, which decodes with ``decode``, and writes features of shape (1,)."""
    import lerobot.datasets.lerobot_dataset as module

    module.decode_video_frames = decode
    datasets.Value.encode_example = _encoded
    return module.LeRobotDataset
