"""Check that this interpreter can train and run policies: the last step of ``tools/policies.sh``.

It imports LeRobot, calls a compiled operator of torchvision, computes one action of a small ACT and decodes a
video with LeRobot's own decoder. Exit code 1 says that policies do not run here. A missing decoder is only a
warning.
"""

from __future__ import annotations

import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

DISTRIBUTIONS = ("lerobot", "torch", "torchvision", "torchcodec")
FPS = 10


def main() -> int:
    """Run the checks in turn, and report the first that fails."""
    installed = ", ".join(_installed(name) for name in DISTRIBUTIONS)
    for purpose, check, remedy in (
        (
            "torchvision does not work with this torch",
            call_torchvision,
            "install both in one call of pip, from the same index: tools/policies.sh FOLDER [words for pip]",
        ),
        (
            "LeRobot cannot compute an action",
            compute_action,
            "install the tested versions: pip install --no-deps -r constraints-learn.txt",
        ),
    ):
        try:
            check()
        except Exception as error:  # noqa: BLE001 (whatever a library raises is the finding)
            _report("error", f"{purpose}: {type(error).__name__}: {_first_line(error)}", installed, remedy)
            return 1
    try:
        decode_video()
    except Exception as error:  # noqa: BLE001 (as above)
        _report(
            "warning",
            f"LeRobot's own scripts cannot read recordings with videos: {_first_line(error)}",
            installed,
            "install FFmpeg's libraries: sudo apt install ffmpeg (Debian, Ubuntu). JOSHUA needs none",
        )
    sys.stderr.write(f"checked: ACT computed an action with {installed}\n")
    return 0


def call_torchvision() -> None:
    """Call an operator that torchvision has compiled against its torch."""
    import torch
    from torchvision.ops import nms

    boxes = torch.tensor([[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]])
    kept = nms(boxes, torch.tensor([0.9, 0.8]), 0.5)
    if kept.tolist() != [0]:
        raise RuntimeError(f"torchvision.ops.nms returned {kept.tolist()} instead of [0]")


def compute_action() -> None:
    """Compute one action of a small ACT with random weights, from one image and six joints."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy

    config = ACTConfig(
        input_features={
            "observation.state": PolicyFeature(FeatureType.STATE, (6,)),
            "observation.images.top": PolicyFeature(FeatureType.VISUAL, (3, 64, 64)),
        },
        output_features={"action": PolicyFeature(FeatureType.ACTION, (6,))},
        chunk_size=4,
        n_action_steps=4,
        dim_model=32,
        n_heads=2,
        dim_feedforward=32,
        n_encoder_layers=1,
        pretrained_backbone_weights=None,
        device="cpu",
    )
    policy: Any = ACTPolicy(config)
    policy.eval()
    observation = {
        "observation.state": torch.zeros(1, 6),
        "observation.images.top": torch.zeros(1, 3, 64, 64),
    }
    with torch.inference_mode():
        action = policy.select_action(observation)
    if tuple(action.shape) != (1, 6) or not bool(torch.isfinite(action).all()):
        raise RuntimeError(
            f"ACT returned an action of shape {tuple(action.shape)} instead of (1, 6), or not finite"
        )


def decode_video() -> None:
    """Encode three grey images as H.264 and decode them as LeRobot decodes a recording."""
    import av
    import numpy as np
    from lerobot.datasets.video_utils import decode_video_frames, get_safe_default_codec

    levels = (0, 128, 255)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grey.mp4"
        with av.open(str(path), "w") as container:
            stream: Any = container.add_stream("libx264", rate=FPS)
            stream.width = stream.height = 64
            stream.pix_fmt = "yuv420p"
            for level in levels:
                image = np.full((64, 64, 3), level, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            container.mux(stream.encode(None))
        times_s = [number / FPS for number in range(len(levels))]
        frames = decode_video_frames(path, times_s, 1e-3, get_safe_default_codec())
    means = [float(frame.mean()) * 255 for frame in frames]
    if any(abs(mean - level) > 4 for mean, level in zip(means, levels, strict=True)):
        raise RuntimeError(f"the decoded images have the mean values {means} instead of {list(levels)}")


def _installed(name: str) -> str:
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"no {name}"


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _report(level: str, text: str, installed: str, remedy: str) -> None:
    sys.stderr.write(f"{level}: {text}\n  found: {installed}\n  next: {remedy}\n")


if __name__ == "__main__":
    sys.exit(main())
