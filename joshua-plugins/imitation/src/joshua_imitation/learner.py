"""Learning in updates, with a state that can be saved after each."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joshua_training.memory import is_out_of_memory, remedied
from joshua_training.run_folder import RunError, RunFolder, read_part
from safetensors import SafetensorError
from safetensors.torch import load, save_file

from joshua_imitation.batch_norm import Statistics
from joshua_imitation.data import Array, Recording
from joshua_imitation.group import Group, OthersError
from joshua_imitation.loader import Batch, Loader, Maker, Order, Share
from joshua_imitation.policies import MORE_MEMORY, Parts, save_policy
from joshua_imitation.settings import ImitationSettings

POLICY, TRAINING, STATE = "pretrained_model", "training.safetensors", "state.json"

_DTYPES = {"bfloat16": torch.bfloat16, "float16": torch.float16}


#: Most updates in a row that float16 skips. Each halves the scale of the loss, which ends below 1 by then.
MOST_SKIPPED = 20

_NORM = "optimiser/gradient_norm"

#: What the seed of the noise of a batch has beside other seeds.
_NOISE = 3


class DivergedError(RunError):
    """The loss or the gradient is not a number."""


class Learner:
    """Trains a policy.

    Args:
        settings: of the file; parts: what is trained; recording: training data.
        maker: of training batches; judge: of validation batches; frames: of both.
        folder: of the run; group: this process; its device is name of torch's.

    Attributes:
        steps: updates so far; total: of the whole training.
        stops: set when learning has to stop; stopped: set after the last update of all processes.
    """

    def __init__(
        self,
        settings: ImitationSettings,
        parts: Parts,
        recording: Recording,
        maker: Maker,
        judge: Maker,
        order: Order,
        kept_back: Array,
        total: int,
        folder: RunFolder,
        group: Group,
    ) -> None:
        self._settings, self.parts, self._recording = settings, parts, recording
        self._maker, self._judge, self._order, self._kept_back = maker, judge, order, kept_back
        self.total, self._folder, self._group, self._device = total, folder, group, group.device
        self._statistics = Statistics(parts.policy)
        self.steps = 0
        self.stops = self.stopped = False
        self._half = _DTYPES.get(settings.precision)
        # without an accelerator it has no effect
        self._scaler = torch.amp.GradScaler(group.device, enabled=settings.precision == "float16")
        self._window: dict[str, float] = {}
        self._window_steps = self._window_skipped = 0
        self._skipped_in_a_row = 0
        self._loader: Loader | None = None
        self._last_batch: Batch = {}
        self._began_s = time.perf_counter()
        self._waited_s = 0.0

    def begin(self) -> None:
        """Take the weights of the first process, after all have joined. Raises RunError."""
        weights = [weight for weight in self.parts.policy.parameters() if weight.requires_grad]
        self._group.begin(weights, (self.steps, self.total, len(self._recording)))

    def update(self) -> dict[str, float] | None:
        """Learn from the next batches; return a row of metrics if one is due.

        Raises:
            DivergedError: the loss or the gradient is not a number; the weights are those from before.
            RunError: the memory does not suffice.
        """
        if self._loader is None:
            self._loader = Loader(self._maker, self._order, self.steps, self.total, self._settings.workers)
            self._began_s, self._waited_s = time.perf_counter(), 0.0
        failure: RunError | None = None
        found: dict[str, float] = {}
        self._statistics.keep()
        try:
            with remedied(self._settings.halves(self._device), self._folder):
                found = self._gradients(next(self._loader))
        except RunError as error:
            failure = error
        has_failed, self.stopped = self._group.agree(failure is not None, self.stops)
        if has_failed:
            self.parts.optimiser.zero_grad()
            self._statistics.undo()
            raise failure or OthersError("another process of the training failed: see its message")
        self._step(found)
        self.steps += 1
        due = self.steps % self._settings.report_steps == 0 or self.steps == self.total
        row = self._row() if due else None
        if len(self._kept_back) and (
            self.steps % self._settings.validation_steps == 0 or self.steps == self.total
        ):
            row = (row or {"steps": self.steps}) | {"loss/validation": self.validate()}
        return row

    def validate(self) -> float:
        """Return the loss on the episodes kept back, with the same noise each time."""
        policy, settings = self.parts.policy, self._settings
        count = min(len(self._kept_back), settings.validation_batches * settings.batch_size)
        chosen = self._kept_back[np.linspace(0, len(self._kept_back) - 1, count).astype(int)]
        total = 0.0
        before = time.perf_counter()
        policy.eval()
        if settings.policy_type == "act":
            policy.model.training = True  # LeRobot computes the divergence, a part of the loss, only so
        with torch.random.fork_rng(devices=self._devices()), torch.no_grad():
            torch.manual_seed(settings.seed)
            for start in range(0, count, settings.batch_size):
                frames = chosen[start : start + settings.batch_size]
                loss, _ = self._loss(self._judge.make(frames))
                total += float(loss) * len(frames)
        policy.train()
        self._began_s += time.perf_counter() - before  # rates are those of learning
        return total / count

    def paused(self, seconds: float) -> None:
        """Leave a pause out of the rates."""
        self._began_s += seconds

    def close(self) -> None:
        """End the threads."""
        if self._loader is not None:
            self._loader.close()

    def _gradients(self, batches: list[tuple[Share, Batch]]) -> dict[str, float]:
        """Add up the gradients of the batches of this process; return its part of the losses."""
        self.parts.policy.train()
        found: dict[str, float] = {}
        for share, batch in batches:
            # the noise depends on the batch alone, not on the process that learns it
            torch.manual_seed(self._noise(share))
            loss, terms = self._loss(batch)
            value = float(loss.detach())
            if not np.isfinite(value):
                raise self._diverged("the loss", batch)
            self._scaler.scale(loss if share.weight == 1.0 else loss * share.weight).backward()
            for name, term in {"loss/train": value, **terms}.items():
                found[name] = found.get(name, 0.0) + share.weight * term
            self._last_batch = batch
            self._statistics.collect(share.weight)
        return found

    def _noise(self, share: Share) -> int:
        words = (self._settings.seed, _NOISE, self.steps, share.number)
        return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> np.uint64(1))

    def _step(self, found: dict[str, float]) -> None:
        """Change the weights by the gradients of all processes."""
        parts, optimiser = self.parts, self.parts.optimiser
        names = sorted(found)
        found = dict(zip(names, self._group.sum([found[name] for name in names]), strict=True))
        self._group.sum_each([w.grad for w in parts.policy.parameters() if w.grad is not None])
        self._scaler.unscale_(optimiser)
        norm = float(torch.nn.utils.clip_grad_norm_(parts.policy.parameters(), parts.max_norm))
        skips = not np.isfinite(norm)
        self._skipped_in_a_row = self._skipped_in_a_row + 1 if skips else 0
        if skips and (not self._scaler.is_enabled() or self._skipped_in_a_row == MOST_SKIPPED):
            optimiser.zero_grad()
            raise self._diverged("the gradient", self._last_batch)
        if not skips:
            self._scaler.step(optimiser)
            self._statistics.apply(self._group)
            if parts.schedule is not None:
                parts.schedule.step()
            if hasattr(parts.policy, "update"):
                parts.policy.update()
            found[_NORM] = norm
        self._scaler.update()  # a smaller scale after a skipped step
        optimiser.zero_grad()
        for name, value in found.items():
            self._window[name] = self._window.get(name, 0.0) + value
        self._window_steps += 1
        self._window_skipped += skips

    def _loss(self, batch: Batch) -> tuple[Any, dict[str, float]]:
        with self._precision():
            loss, terms = self.parts.policy.forward(self.parts.before(dict(batch)))
        return loss, {
            f"loss/{name}": float(value)
            for name, value in (terms or {}).items()
            if name.endswith("_loss") and isinstance(value, (int, float))
        }

    def _precision(self) -> AbstractContextManager[Any]:
        return torch.autocast(self._device, self._half) if self._half is not None else nullcontext()

    def _devices(self) -> list[int]:
        return [torch.cuda.current_device()] if self._device == "cuda" else []

    def _row(self) -> dict[str, float]:
        count = max(1, self._window_steps)
        norms = count - self._window_skipped
        row = {name: value / (norms if name == _NORM else count) for name, value in self._window.items()}
        now_s = time.perf_counter()
        took_s, began_waited = max(now_s - self._began_s, 1e-9), self._waited_s
        waited_s = self._loader.waited_s if self._loader is not None else 0.0
        self._began_s, self._waited_s = now_s, waited_s
        self._window, self._window_steps, self._window_skipped = {}, 0, 0
        return {
            "steps": self.steps,
            "epoch": self.steps / self._order.updates_per_epoch,
            **row,
            "optimiser/learning_rate": float(self.parts.optimiser.param_groups[0]["lr"]),
            "rate/updates_per_s": count / took_s,
            "rate/loader_share": (waited_s - began_waited) / took_s,
        }

    def _diverged(self, what: str, batch: Batch) -> DivergedError:
        name = f"failed_batch_{self.steps + 1}" + (f"_{self._group.rank}" if self._group.rank else "")
        path = self._folder.path / f"{name}.safetensors"
        try:
            save_file({key: value for key, value in batch.items() if isinstance(value, torch.Tensor)}, path)
            kept = f"its batch is in {path}"
        except (OSError, SafetensorError) as error:
            kept = f"its batch cannot be written: {error}"
        bad = [
            key
            for key, value in batch.items()
            if isinstance(value, torch.Tensor)
            and value.is_floating_point()
            and not torch.isfinite(value).all()
        ]
        remedy = (
            f"{', '.join(bad)} of the data set has values that are not numbers: run `joshua dataset check "
            f"{self._recording.dataset.folder}`"
            if bad
            else 'set precision: "bfloat16", or lower learning_rate'
            if self._scaler.is_enabled()
            else 'lower learning_rate or max_grad_norm, or set precision: "float32"'
        )
        return DivergedError(
            f"{what} is not a number at update {self.steps + 1}; {kept}, the weights before it are kept: "
            f"{remedy}"
        )

    def save(self) -> Path:
        """Write a checkpoint. Raises RunError."""
        return self._folder.save_by(self.steps, self._write)

    def _write(self, folder: Path) -> None:
        parts = self.parts
        try:
            final = self._folder.checkpoint(self.steps) / POLICY
            save_policy(parts, self._recording.dataset, folder / POLICY, final)
            arrays = {"generator.torch": torch.get_rng_state()}
            if self._device == "cuda":
                arrays["generator.cuda"] = torch.cuda.get_rng_state()
            for index, memory in parts.optimiser.state_dict()["state"].items():
                for name, value in memory.items():
                    arrays[f"optimiser.{index}.{name}"] = torch.as_tensor(value).detach().cpu().contiguous()
            if parts.adapters:
                for name, weight in parts.policy.named_parameters():
                    if weight.requires_grad:
                        arrays[f"weight.{name}"] = weight.detach().cpu().contiguous()
            save_file(arrays, folder / TRAINING)
        except SafetensorError as error:  # a full disk, as the library reports it
            raise _as_os_error(error) from error
        state = {
            "format": 1,
            "steps": self.steps,
            "total": self.total,
            "window": self._window,
            "window_steps": self._window_steps,
            "window_skipped": self._window_skipped,
            "learning_rates": [group["lr"] for group in parts.optimiser.param_groups],
            "schedule": _plain(parts.schedule.state_dict()) if parts.schedule is not None else None,
            "scaler": self._scaler.state_dict() if self._scaler.is_enabled() else None,
        }
        (folder / STATE).write_text(json.dumps(state, indent=2, sort_keys=True) + "\n", encoding="utf-8")

    @remedied(MORE_MEMORY)
    def restore(self, folder: Path) -> None:
        """Continue from a checkpoint, whose weights the policy already has.

        Raises:
            RunError: a file is missing, truncated or not from this trainer, or belongs to another network.
        """
        arrays, state = read_state(folder)
        parts = self.parts
        memory: dict[int, dict[str, Any]] = {}
        weights = dict(parts.policy.named_parameters())
        try:
            for key, value in arrays.items():
                kind, _, rest = key.partition(".")
                if kind == "optimiser":
                    index, _, name = rest.partition(".")
                    memory.setdefault(int(index), {})[name] = value
                elif kind == "weight":
                    weights[rest].data.copy_(value)
            whole = parts.optimiser.state_dict()
            if memory and set(memory) - set(
                range(sum(len(group["params"]) for group in whole["param_groups"]))
            ):
                raise ValueError("its optimiser has more weights than the policy")
            whole["state"] = memory
            parts.optimiser.load_state_dict(whole)
            if parts.schedule is not None:
                self._continue_schedule(dict(state["schedule"]), state["learning_rates"])
            if self._scaler.is_enabled() and state["scaler"]:
                self._scaler.load_state_dict(state["scaler"])
            torch.set_rng_state(arrays["generator.torch"])
            if self._device == "cuda" and "generator.cuda" in arrays:
                torch.cuda.set_rng_state(arrays["generator.cuda"])
            self.steps = int(state["steps"])
            self._window, self._window_steps = dict(state["window"]), int(state["window_steps"])
            self._window_skipped = int(state.get("window_skipped", 0))
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            if is_out_of_memory(error):
                raise
            raise RunError(
                f"the checkpoint {folder} does not fit the policy of this file: {error}: continue with the "
                "settings of the run"
            ) from error

    def _continue_schedule(self, saved: dict[str, Any], rates: Sequence[float]) -> None:
        """Continue where the step size was, in proportion to the ``learning_rate`` of this file."""
        schedule, groups = self.parts.schedule, self.parts.optimiser.param_groups
        for group, rate, then, now in zip(
            *(groups, rates, saved.pop("base_lrs"), schedule.base_lrs), strict=True
        ):
            group["lr"] = rate * (now / then)
        saved["_last_lr"] = [group["lr"] for group in groups]
        schedule.load_state_dict(schedule.state_dict() | saved)


def read_state(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the parts of a checkpoint beside its policy. Raises RunError."""
    return (
        read_part(folder, TRAINING, load, "generator.torch"),
        read_part(folder, STATE, json.loads, "steps", "learning_rates", "window", "window_steps"),
    )


def _as_os_error(error: SafetensorError) -> OSError:
    """Return what the library wraps, such as a full disk."""
    found = re.search(r"os error (\d+)", str(error))
    return OSError(int(found.group(1)), os.strerror(int(found.group(1)))) if found else OSError(str(error))


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state of a schedule without its functions, which the settings recreate."""
    return {
        key: value
        for key, value in values.items()
        if key in ("base_lrs", "last_epoch", "_last_lr", "_step_count")
    }
