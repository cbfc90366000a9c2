"""Processes that learn together by accelerate: same weights, different batches, averaged gradients."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import torch
from joshua_training.run_folder import LibraryMissing, RunError

from joshua_imitation.scratch import Scratch
from joshua_imitation.settings import ImitationSettings

#: Longest wait for the others: they read the data set, or compute an update.
PATIENCE = timedelta(minutes=30)

#: Longest text that processes tell each other, in bytes: a path.
_TEXT = 4096

#: How long the other processes of a machine have to end by themselves.
PARTING_S = 3.0


class OthersError(RunError):
    """Another process of the training failed, or cannot be reached."""


class LostError(OthersError):
    """Another process of the training cannot be reached."""


@dataclass
class Group:
    """One process of a training, and its connection to the others.

    Attributes:
        size: processes of all machines; rank: number of this one; local: its number on this machine.
        each: processes of each machine; address: host and port of rank 0; device: name of torch's.
    """

    size: int = 1
    rank: int = 0
    local: int = 0
    each: int = 1
    address: str = ""
    device: str = "cpu"

    @classmethod
    def of(cls, settings: ImitationSettings, device: str, local: int = 0, address: str = "") -> Group:
        """Return a process of this machine."""
        each = settings.processes
        return cls(
            size=each * settings.machines,
            rank=settings.machine_rank * each + local,
            local=local,
            each=each,
            address=address or settings.main_address or f"127.0.0.1:{_free_port()}",
            device=device,
        )

    @classmethod
    def of_environment(cls, device: str) -> Group:
        """Return a process that others have connected, as the variables of ``torchrun`` say."""
        size, rank, local, each = (
            int(os.environ[name]) for name in ("WORLD_SIZE", "RANK", "LOCAL_RANK", "LOCAL_WORLD_SIZE")
        )
        address = f"{os.environ['MASTER_ADDR']}:{os.environ['MASTER_PORT']}"
        return cls(size, rank, local, each, address, device)

    def take_gpu(self) -> None:
        """Make the GPU of this process, if it has one, current for the calling thread.

        A thread begins with the first GPU: what it builds or learns before would be on that of another
        process.
        """
        if self.device == "cuda":
            torch.cuda.set_device(self.local)

    def join(self) -> None:
        """Connect to the others, and wait for them. Raises RunError; LibraryMissing."""
        if self.size == 1:
            return
        host, _, port = self.address.rpartition(":")
        os.environ.update(
            RANK=str(self.rank),
            WORLD_SIZE=str(self.size),
            LOCAL_RANK=str(self.local),
            LOCAL_WORLD_SIZE=str(self.each),
            MASTER_ADDR=host,
            MASTER_PORT=port,
        )
        if self.each == self.size and sys.platform == "linux" and not torch.distributed.is_initialized():
            os.environ.update(GLOO_SOCKET_IFNAME="lo", NCCL_SOCKET_IFNAME="lo")
        threads = torch.get_num_threads()
        os.environ.setdefault("OMP_NUM_THREADS", str(threads))
        try:
            from accelerate import Accelerator, InitProcessGroupKwargs
        except ImportError as error:
            raise LibraryMissing(
                "several processes require accelerate, which is not installed: install "
                "joshua-imitation[learn], or remove processes and machines"
            ) from error
        try:
            Accelerator(cpu=self.device == "cpu", kwargs_handlers=[InitProcessGroupKwargs(timeout=PATIENCE)])
        except (RuntimeError, ValueError, OSError) as error:
            said = " ".join(str(error).split())[:200]
            raise RunError(
                f"process {self.rank} of {self.size} cannot meet the others at {self.address}: {said}: start "
                "the file on every machine, each with its own machine_rank, and open that port"
            ) from error
        torch.set_num_threads(threads)

    def close(self) -> None:
        """Leave the others."""
        if torch.distributed.is_initialized():
            torch.distributed.destroy_process_group()

    def agree(self, failed: bool, stops: bool) -> tuple[bool, bool]:
        """Return whether any process failed, and whether any has to stop."""
        failures, stopping = self.sum([float(failed), float(stops)])
        return failures > 0, stopping > 0

    def sum(self, values: Sequence[float]) -> list[float]:
        """Return the sums of some numbers over all processes. Raises RunError."""
        if self.size == 1:
            return list(values)
        summed = torch.tensor(values, dtype=torch.float64, device=self.device)
        self._reduced(summed)
        return [float(value) for value in summed.tolist()]

    def gather(self, text: str) -> list[str]:
        """Return a short text of every process, in their order. Raises RunError."""
        said = torch.zeros((self.size, _TEXT), dtype=torch.uint8, device=self.device)
        content = text.encode()
        said[self.rank, : len(content)] = torch.tensor(list(content), dtype=torch.uint8)
        if self.size > 1:
            self._reduced(said)
        return [bytes(row.tolist()).rstrip(b"\0").decode() for row in said]

    def sum_each(self, values: Sequence[Any]) -> None:
        """Replace each tensor by its sum over all processes. Raises RunError."""
        if self.size == 1:
            return
        summed = torch.cat([value.reshape(-1).float() for value in values])
        self._reduced(summed)
        at = 0
        for value in values:
            value.copy_(summed[at : at + value.numel()].view_as(value))
            at += value.numel()

    def begin(self, weights: Iterable[Any], facts: Sequence[int]) -> None:
        """Take the weights of rank 0. Raises RunError if the processes differ in some facts."""
        if self.size == 1:
            return
        sums = self.sum([float(value) for fact in facts for value in (fact, fact * fact)])
        for fact, total, squared in zip(facts, sums[::2], sums[1::2], strict=True):
            if total != fact * self.size or squared != fact * fact * self.size:
                raise RunError(
                    "the processes differ in data set or checkpoint: give every machine the same data set, "
                    "settings and resume_run"
                )
        for weight in weights:
            torch.distributed.broadcast(weight.data, 0)

    def _reduced(self, values: Any) -> None:
        try:
            torch.distributed.all_reduce(values)
        except RuntimeError as error:
            raise LostError(
                f"process {self.rank} of {self.size} lost the others: {str(error).strip().splitlines()[0]}: "
                "see their messages, and continue with resume_run"
            ) from error


class Crew:
    """The further processes of this machine.

    Args:
        settings: of the training; group: of this process; run: its folder.
        album: folder that the album shares, None without; continued: checkpoint, None for a new run.
    """

    def __init__(
        self,
        settings: ImitationSettings,
        group: Group,
        run: Path,
        album: Path | None,
        continued: Path | None,
    ) -> None:
        told = {
            "settings": settings.model_dump(mode="json"),
            "address": group.address,
            "device": group.device,
            "run": str(run),
            "album": str(album) if album is not None else "",
            "continued": str(continued) if continued is not None else "",
        }
        self._log = run / "processes.log"
        # what the processes decode from a stream, also where they cannot remove it themselves
        self._scratch = Scratch("joshua-processes")
        self._children: list[subprocess.Popen[bytes]] = []
        for local in range(1, settings.processes):
            with self._log.open("ab") as log:
                child = subprocess.Popen(
                    [sys.executable, "-m", "joshua_imitation.worker"],
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=log,
                    env=os.environ | {"TMPDIR": str(self._scratch.path)},
                )
            assert child.stdin is not None
            child.stdin.write(json.dumps({**told, "local": local}).encode() + b"\n")
            child.stdin.flush()  # its end tells the child that this process has ended
            self._children.append(child)

    def failure(self, patience_s: float = 0.0) -> str:
        """Return why a process ended early, in its own words; "" if all run for some time."""
        until_s = time.monotonic() + patience_s
        codes = [child.poll() for child in self._children]
        while not any(codes) and time.monotonic() < until_s:
            time.sleep(0.05)
            codes = [child.poll() for child in self._children]
        code = next((code for code in codes if code), 0)
        if not code:
            return ""
        lines = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        said = f"it was ended by signal {-code}" if code < 0 else lines[-1] if lines else f"exit code {code}"
        return f"a process of this training failed: {said} ({self._log})"

    def close(self) -> None:
        """End the processes."""
        until_s = time.monotonic() + PARTING_S
        for child in self._children:
            try:
                child.wait(max(0.0, until_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
            assert child.stdin is not None
            child.stdin.close()
        self._scratch.close()


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])
