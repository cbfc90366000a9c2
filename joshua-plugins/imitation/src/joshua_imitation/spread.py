"""A training whose processes are the workers of a cluster: what each of them does, and who follows them.

The workers learn as several processes of one machine do. The first of them writes the checkpoints into the
run's folder, which is the same on every machine. When a worker is lost, all begin again from the last one.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import torch
from joshua_jobs.executor import Disconnected, Executor, Joint, Post
from joshua_training.run_folder import RunError, RunFolder

from joshua_imitation.build import Built, build, refuse_half
from joshua_imitation.group import Group, LostError, OthersError
from joshua_imitation.learner import Learner
from joshua_imitation.scratch import Scratch
from joshua_imitation.settings import ImitationSettings

#: How often the first worker tells its progress where no metrics are due.
TELL_S = 0.5

#: Stands for what nobody tells any more.
_GONE: Mapping[str, Any] = {"ended": True}

_Found = TypeVar("_Found")


class SpreadLearner:
    """Follows the workers, in the place of a learner of this process.

    Args:
        executor: the cluster; settings: of the training; folder: of the run.
        steps: updates so far; total: of the whole training.
        rewind: called with updates whose later rows are computed again.

    Attributes:
        stops, stopped: see ``Learner``; lost: workers that were lost; checkpoint: the last one, "" before.
    """

    def __init__(
        self,
        executor: Executor,
        settings: ImitationSettings,
        folder: RunFolder,
        steps: int,
        total: int,
        rewind: Callable[[int], None],
    ) -> None:
        self.steps, self.total, self._rewind, self._executor = steps, total, rewind, executor
        self.stops = self.stopped = False
        self.checkpoint = ""
        self.learns = False
        private = {"cluster", "cluster_workers", "resume_run", "tracking"}
        told = {
            "settings": settings.model_dump(mode="json", exclude=private),
            "run": str(folder.path),
            "name": f"joshua-training-{os.urandom(8).hex()}",
        }
        gpus = {"auto": None, "cuda": True}.get(settings.device, False)
        self._told = executor.together(Joint(learn, told, settings.size, gpus, lambda: self.stops))

    @property
    def lost(self) -> int:
        """Workers that were lost so far."""
        return self._executor.lost

    def update(self) -> dict[str, float] | None:
        """Wait a moment for what the workers tell; return a row of metrics if there is one.

        Raises:
            RunError: they cannot learn; JobError: there are too few, or none.
        """
        if self.stops and not self.learns:
            self.stopped = True  # before there was anything to save
            return None
        told = next(self._told, _GONE)
        if told is None:
            return None
        row = self._take(told)
        if self.stopped or self.steps >= self.total:
            for more in self._told:  # until all have ended, and the last checkpoint is there
                if more is not None:
                    row = self._take(more) or row
        return row

    def _take(self, told: Mapping[str, Any]) -> dict[str, float] | None:
        self.learns = True
        if "after" in told and told["after"] < self.steps:
            self._rewind(told["after"])
        self.steps = told.get("steps", self.steps)
        self.checkpoint = told.get("saved") or self.checkpoint
        self.stopped = bool(told.get("ended"))
        row: dict[str, float] | None = told.get("row")
        return row

    def close(self) -> None:
        """Leave the cluster, which ends its workers."""
        self._executor.close()


def learn(told: dict[str, Any], post: Post) -> None:
    """Learn in one of several connected workers, to the end or until the caller stops.

    Raises:
        Disconnected: a worker is lost. RunError: learning cannot go on.
    """
    os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
    settings = ImitationSettings.model_validate(told["settings"])
    device = "cuda" if os.environ.get("ACCELERATE_TORCH_DEVICE", "").startswith("cuda") else "cpu"
    group = Group.of_environment(device)
    torch.set_num_threads(settings.threads or max(1, len(os.sched_getaffinity(0)) // group.each))
    try:
        group.join()
        with _scratch(told["name"], group):
            _learn(settings, group, Path(told["run"]), post)
    except LostError as error:
        raise Disconnected(str(error)) from error
    except OthersError:
        return  # that one tells why


def _learn(settings: ImitationSettings, group: Group, path: Path, post: Post) -> None:
    def opened() -> tuple[RunFolder, Path | None]:
        refuse_half(settings, group.device)
        if not (path / "run.json").is_file():
            raise RunError(
                f"{path} does not exist: give the folder of the runs the same path on every machine, for "
                "example on a network file system"
            )
        folder = RunFolder(path)
        return folder, next(reversed(folder.checkpoints()), None)

    folder, continued = _by_all(group, opened)
    with contextlib.ExitStack() as ends:
        made = _built(settings, group, continued, ends)

        def learner_of_all() -> Learner:
            learner = made.learner(folder)
            ends.callback(learner.close)
            if continued is not None:
                learner.restore(continued)
            return learner

        learner = _by_all(group, learner_of_all)
        learner.begin()
        _follow(learner, settings, group.rank == 0, post)


def _built(
    settings: ImitationSettings, group: Group, continued: Path | None, ends: contextlib.ExitStack
) -> Built:
    """Build the training; the first worker of a machine keeps the pictures for all there."""

    def built(shared: Path | None = None) -> Built:
        made = build(settings, continued, group, shared)
        ends.callback(made.album.close)
        return made

    def first() -> Built | None:
        if group.local:
            return None
        made = built()
        made.album.fill(lambda count: True)
        return made

    made = _by_all(group, first)
    shared = made.album.shared if made is not None else None
    places = group.gather(str(shared or ""))
    place = places[group.rank - group.local]
    return _by_all(group, lambda: made or built(Path(place) if place else None))


def _follow(learner: Learner, settings: ImitationSettings, tells: bool, post: Post) -> None:
    """Make the updates; the first worker saves, and tells what there is."""
    began = kept = learner.steps
    told_s = float("-inf")
    while learner.steps < learner.total and not learner.stopped:
        learner.stops = post.stopping
        before = learner.steps
        try:
            row = learner.update()
        except LostError:
            raise
        except RunError:
            if tells and before != kept:
                post.tell({"steps": before, "saved": str(learner.save())})
            raise
        if not tells:
            continue
        news: dict[str, Any] = {"steps": learner.steps, "row": row}
        if before == began:
            news["after"] = began
        saves = learner.steps - kept >= settings.checkpoint_steps
        if len(news) > 2 or saves or row is not None or time.monotonic() - told_s >= TELL_S:
            post.tell(news)  # before the checkpoint, after which no worker would compute it again
            told_s = time.monotonic()
        if saves:
            path, kept = learner.save(), learner.steps
            post.tell({"steps": kept, "saved": str(path)})
    if tells:
        last = str(learner.save()) if learner.steps != kept else ""
        post.tell({"steps": learner.steps, "saved": last, "ended": True})


def _by_all(group: Group, work: Callable[[], _Found]) -> _Found:
    """Do something in every worker, and raise where it failed in any: the message names the node."""
    try:
        found = work()
    except RunError as error:
        group.agree(True, False)
        raise type(error)(f"on the node {os.uname().nodename}, {error}") from error
    if group.agree(False, False)[0]:
        raise OthersError("another worker of the training failed: see its message")
    return found


@contextlib.contextmanager
def _scratch(name: str, group: Group) -> Iterator[None]:
    """Keep temporary files in a folder that workers which begin again find and remove."""
    place = Path(tempfile.gettempdir())
    if group.local == 0:
        for left in place.glob(f"{name}-*"):
            shutil.rmtree(left, ignore_errors=True)
    group.sum([0.0])
    scratch = Scratch(name)
    tempfile.tempdir = str(scratch.path)
    try:
        yield
    finally:
        scratch.close()
        tempfile.tempdir = str(place)
