"""Export policies of joshua-ppo-trainer without PyTorch: their files and one network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from joshua.tools import parse_json
from joshua_lerobot.checkpoint import CheckpointError
from joshua_lerobot.loading import require

from joshua_onnx.model import open_session
from joshua_onnx.settings import NETWORK

ABOUT = "policy.json"

_ACTIVATIONS = {"tanh": "Tanh", "relu": "Relu", "elu": "Elu"}

#: Largest difference between a policy and its export.
LARGEST_DIFFERENCE = 1e-5


def is_trained_here(folder: Path) -> bool:
    """Return whether a folder is a run of joshua-ppo-trainer, or one of its checkpoints."""
    return (folder / ABOUT).is_file() or (folder / "run.json").is_file()


def export_trained(folder: Path, target: Path) -> Iterator[str]:
    """Write the newest policy of a run as ONNX into a folder, and yield what was written.

    Raises:
        CheckpointError: it cannot be exported; ModelError: a library is missing.
    """
    steps = sorted((folder / "checkpoints").glob("step_*"))
    found = folder if (folder / ABOUT).is_file() or not steps else steps[-1]
    policy_of = require("joshua_ppo_trainer.policy", "Exporting a policy of PPO").Policy
    try:
        policy = policy_of.load(found)
    except Exception as error:  # of that distribution
        raise CheckpointError(str(error), "Name the folder of a run, or of one of its checkpoints") from error
    network = _network(policy)
    width = policy.layers[0][0].shape[1]
    seen = np.random.default_rng(1).normal(0, 1, (64, width)).astype(np.float32)
    session = open_session(network, _on_cpu(), NETWORK)
    given = np.concatenate([session.run(["action"], {"observation": row[None]})[0] for row in seen])
    difference = float(np.abs(given - policy.act(seen)).max())
    if not difference <= LARGEST_DIFFERENCE:
        raise CheckpointError(
            f"The exported policy differs from {found} by {difference:.3g}, more than {LARGEST_DIFFERENCE:g}",
            "Run the checkpoint itself, and report this",
        )
    target.mkdir(parents=True, exist_ok=True)
    (target / NETWORK).write_bytes(network)
    shutil.copy(found / ABOUT, target / ABOUT)
    yield f"{target / NETWORK}: {len(network) / 1e3:.3g} kB, largest difference {difference:.1e}"
    environment = parse_json((found / ABOUT).read_text(encoding="utf-8"))["environment"]
    yield f"{environment}: run it with plugin_config {{ [joshua/joshua.PpoPolicy] {{ … }} }}"


def _on_cpu() -> Any:
    from joshua.api.models import Compute

    return Compute(device="cpu")


def _network(policy: Any) -> bytes:
    """Return the policy as a function of one observation, shape (1, K)."""
    onnx = require("onnx", "Exporting a policy")
    helper, numpy_helper = require("onnx.helper", "Exporting"), require("onnx.numpy_helper", "Exporting")
    constants: list[Any] = []
    nodes: list[Any] = []
    last = "observation"

    def constant(name: str, values: Any) -> str:
        constants.append(numpy_helper.from_array(np.asarray(values, np.float32), name))
        return name

    def add(kind: str, *inputs: str, **attributes: Any) -> None:
        nonlocal last
        name = f"value_{len(nodes)}"
        nodes.append(helper.make_node(kind, [last, *inputs], [name], **attributes))
        last = name

    if policy.mean is not None:
        add("Sub", constant("mean", policy.mean))
        add("Div", constant("spread", policy.spread))
        add("Clip", constant("least", -policy.limit), constant("greatest", policy.limit))
    for number, (weight, bias) in enumerate(policy.layers):
        inputs = constant(f"weight_{number}", weight), constant(f"bias_{number}", bias)
        add("Gemm", *inputs, transB=1)
        if number < len(policy.layers) - 1:
            add(_ACTIVATIONS[policy.about["activation"]])
    low, high = constant("low", policy.low), constant("high", policy.high)
    if policy.squash:
        add("Tanh")
        add("Mul", constant("half", (policy.high - policy.low) / 2))
        add("Add", constant("middle", (policy.high + policy.low) / 2))
    add("Max", low)
    nodes.append(helper.make_node("Min", [last, high], ["action"]))
    kind = onnx.TensorProto.FLOAT
    width, size = policy.layers[0][0].shape[1], len(policy.low)
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", kind, [1, width])],
        [helper.make_tensor_value_info("action", kind, [1, size])],
        constants,
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return bytes(made.SerializeToString())
