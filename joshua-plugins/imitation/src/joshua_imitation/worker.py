"""One of several processes of a training: it learns its share of each update, and writes nothing."""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path

import torch
from joshua_training.run_folder import RunError, RunFolder

from joshua_imitation.build import build
from joshua_imitation.group import Group
from joshua_imitation.settings import ImitationSettings


def main() -> int:
    """Learn until the end, as the first line of the input says; the end of the input ends the process."""
    told = json.loads(_line())
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    settings = ImitationSettings.model_validate(told["settings"])
    torch.set_num_threads(settings.threads or max(1, len(os.sched_getaffinity(0)) // settings.processes))
    group = Group.of(settings, told["device"], told["local"], told["address"])
    group.take_gpu()
    continued = Path(told["continued"]) if told["continued"] else None
    try:
        made = build(settings, continued, group, Path(told["album"]) if told["album"] else None)
        learner = made.learner(RunFolder(Path(told["run"])))
        if continued is not None:
            learner.restore(continued)
        group.join()
        learner.begin()
        while learner.steps < learner.total and not learner.stopped:
            learner.update()
        learner.close()
    except RunError as error:
        sys.stderr.write(f"{error}\n")
        sys.stderr.flush()
        os._exit(1)
    group.close()
    return 0


def _line() -> bytes:
    """Read a line without a buffer, whose lock would outlive the thread that waits for the end."""
    found = b""
    while not found.endswith(b"\n"):
        if not (part := os.read(0, 4096)):
            raise SystemExit(1)
        found += part
    return found


def _end_with_the_other() -> None:
    while os.read(0, 1):
        continue
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
