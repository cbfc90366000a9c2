"""The process that runs Isaac Sim: Kit needs the main thread of a process of its own, and may crash it.

It talks with the node of the trainer over a socket that it inherits, in lines of JSON, see ``channel``.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from joshua_training.run_folder import RunError, RunFolder

from joshua_isaac_trainer.channel import Channel

#: File of the samples after which a loss is not a number, in the folder of the run.
BATCH = "diverged.safetensors"


def main(arguments: list[str]) -> int:
    """Run the job that arrives first. Returns the exit code of the process."""
    channel = Channel(socket.socket(fileno=int(arguments[0])))
    job = channel.receive()
    if job is None:
        return 0
    with contextlib.ExitStack() as ends, _reporting(channel, job):
        _work(channel, job, ends)
    return 0


@contextlib.contextmanager
def _reporting(channel: Channel, job: dict[str, Any]) -> Iterator[None]:
    """Send the reason of a failure, before anything is closed: Isaac Sim ends the process when it closes."""
    try:
        yield
    except RunError as error:
        channel.send({"error": str(error), "exit_code": error.exit_code})
    except Exception as error:  # noqa: BLE001 (raised again, it would be lost when Isaac Sim closes)
        traceback.print_exc()
        full = type(error).__name__ == "OutOfMemoryError"
        said = out_of_memory(job) if full else f"{type(error).__name__}: {error}"
        channel.send({"error": said, "exit_code": 1})


def out_of_memory(job: dict[str, Any]) -> str:
    """Say which setting halves the memory of a training."""
    envs = job["settings"]["num_envs"]
    return (
        f"the memory of the GPU is full with {envs} environments: halve num_envs, to {max(1, envs // 2)}, "
        "and batch_size with it, in a new run; the last checkpoint of this one is complete"
    )


def _work(channel: Channel, job: dict[str, Any], ends: contextlib.ExitStack) -> None:
    from isaaclab.app import AppLauncher

    app = AppLauncher({"headless": True, "device": job["device"]}).app
    ends.callback(app.close)
    # from here on, the modules of Isaac Sim exist
    from joshua_isaac_trainer.lab import make_environment

    environment, task = make_environment(job, Path(job["folder"]))
    ends.callback(environment.close)
    learn(channel, job, environment, task)


def learn(channel: Channel, job: dict[str, Any], environment: Any, task: Any) -> None:
    """Answer the requests of the node until it ends: ``advance`` and ``save``, not ``pause``.

    A message that arrives while it advances interrupts that: the answer to ``advance`` has no row then.

    Args:
        environment: for rsl_rl; task: a ``TensorTask``, for the description of the policy.
    """
    from joshua_isaac_trainer.learner import Learner
    from joshua_isaac_trainer.networks import policy_facts
    from joshua_isaac_trainer.settings import IsaacSettings

    settings = IsaacSettings.model_validate(job["settings"])
    learner = Learner(settings, environment, job["device"], job["seed"], channel.has_news)
    if job["checkpoint"]:
        learner.restore(Path(job["checkpoint"]))
    about = policy_facts(job["environment_id"], task.evaluator, 1.0 / task.step_s, settings.activation)
    channel.send({"ready": True, "steps": learner.steps})
    while (request := channel.receive()) is not None:
        if request["do"] == "advance":
            try:
                row = learner.iterate()
            except RunError as error:
                raise RunError(f"{error}; {_kept_batch(learner, Path(job['run']))}") from error
            channel.send({"row": row, "steps": learner.steps})
        elif request["do"] == "save":
            folder = Path(request["folder"])
            try:
                for name, content in learner.files(about).items():
                    (folder / name).write_bytes(content)
            except OSError as error:
                channel.send({"refused": error.strerror or str(error), "number": error.errno or 0})
                continue
            channel.send({"saved": True})


def _kept_batch(learner: Any, run: Path) -> str:
    """Write the samples of the last update and the weights after it; return where."""
    from safetensors.numpy import save

    try:
        path = RunFolder(run).write(BATCH, save(learner.last_batch()))
    except RunError as error:  # which must not hide why learning ended
        return str(error)
    return f"the batch and the weights are in {path}"


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    os._exit(code)  # Kit's exit handlers may hang
