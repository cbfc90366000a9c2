"""Notes the times of each chunk of the inference loop, in the process of the policy, for ``bench_loops.py``.

Imported at the start of Python. A line of the file that LOOP_TIMES names is a chunk: when its state was
measured, when its observation was taken, how long the network took, when the chunk was in the queue; in
seconds, monotonic.
"""

from __future__ import annotations

import json
import os
import sys
import time
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any


def noted_network(took_s: list[float]) -> None:
    """Adds the time of every chunk that ACT's network computes in this process from now on."""
    from lerobot.policies.act.modeling_act import ACTPolicy

    predict = ACTPolicy.predict_action_chunk

    def timed(self: Any, *arguments: Any, **named: Any) -> Any:
        began_s = time.monotonic()
        chunk = predict(self, *arguments, **named)
        took_s.append(time.monotonic() - began_s)
        return chunk

    ACTPolicy.predict_action_chunk = timed


class _BeforeTheNode(MetaPathFinder):
    """Puts the stopwatch around the loop when the node that runs it is imported first."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        if name == "joshua_inference.node":
            sys.meta_path.remove(self)
            from joshua_inference.loop import InferenceLoop

            predict, took_s = InferenceLoop.predict, list[float]()
            file = Path(os.environ["LOOP_TIMES"])

            def timed(self: Any, model: Any, observation: Any, began_ns: int = 0) -> int:
                if not file.exists():
                    noted_network(took_s)
                    file.touch()
                took_s.clear()
                late = predict(self, model, observation, began_ns)
                queued_s = time.monotonic()
                if took_s:
                    offset_ns = time.time_ns() - time.monotonic_ns()
                    observed_ns = observation.stamps_ns["observation.state"] - offset_ns
                    row = (observed_ns / 1e9, began_ns / 1e9, took_s[-1], queued_s)
                    with file.open("a") as lines:
                        lines.write(json.dumps(row) + "\n")
                return late

            InferenceLoop.predict = timed  # type: ignore[method-assign]


if "LOOP_TIMES" in os.environ:
    sys.meta_path.insert(0, _BeforeTheNode())
