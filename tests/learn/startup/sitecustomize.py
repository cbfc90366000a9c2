"""Makes LeRobot importable in every process of a run beside a torch without CUDA, as ``lerobot_here`` does.

Python imports this module at its start where this folder stands in PYTHONPATH.
"""

from __future__ import annotations

import sys
from importlib.abc import MetaPathFinder
from typing import Any


class _BeforeTorchvision(MetaPathFinder):
    """Declares the operators that torchvision expects, when it is imported first."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        if name == "torchvision":
            sys.meta_path.remove(self)
            import torch

            _KEPT.append(library := torch.library.Library("torchvision", "DEF"))
            for operator in ("nms", "qnms"):
                library.define(f"{operator}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")


_KEPT: list[Any] = []
sys.meta_path.insert(0, _BeforeTorchvision())
