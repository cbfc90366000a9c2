"""Base class of the settings of trainers: one block of ``training``, with its folders."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from joshua.api import BlockContext, BlockSettings, FieldError
from joshua.tools import nearest_first
from joshua_jobs.choice import check_address
from joshua_jobs.executor import JobError
from pydantic import Field, model_validator
from typing_extensions import Self

from joshua_training.tracking import CLOSE_S
from joshua_training.tracking_settings import TrackingSettings

#: How long a stop waits for the last files and for the services that record the run, and a margin after that.
SAVE_S, STOP_MARGIN_S = 60.0, 10.0


class RunSettings(BlockSettings):
    """Settings of a run: the fields of one block of ``training``, and the environment beside it.

    Attributes:
        environment: name of its enum value, "" if omitted; environment_id: "" if omitted.
        output_folder: absolute, for the folders of runs; resume_run: folder of the run to continue, or "".
        tracking: services that record the run, too; launching: the run starts, so what it requires must be
            installed. It is not part of the plan.
        cluster: address of a Ray cluster that shares the work, "" for none; cluster_workers: jobs at once,
            None for one per core.
    """

    #: Field of ``training`` that holds the block.
    BLOCK: ClassVar[str]

    #: Fields whose omission, or 0, the schema reports by itself.
    REQUIRED: ClassVar[tuple[str, ...]] = ()

    #: Whether services can record the run.
    TRACKED: ClassVar[bool] = True

    #: Whether a cluster can share the work.
    SPREADS: ClassVar[bool] = False

    environment: str = ""
    environment_id: str = ""
    output_folder: str = ""
    resume_run: str = ""
    tracking: TrackingSettings = TrackingSettings()
    cluster: str = ""
    cluster_workers: int | None = None
    launching: Annotated[bool, Field(exclude=True)] = False

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """Take the fields of the block, and make folders absolute."""
        del node
        block: Mapping[str, Any] = values[cls.BLOCK] or {}
        folder = Path(context.folder)
        known = {
            name: value
            for name, value in block.items()
            if name in cls.model_fields and value is not None and not (name in cls.REQUIRED and not value)
        }
        known["output_folder"] = str(folder / (block.get("output_folder") or "runs"))
        if block.get("resume_run"):
            known["resume_run"] = str(folder / Path(block["resume_run"]).expanduser())
        known |= {"tracking": TrackingSettings.of(values, folder), "launching": context.launch}
        if values["cluster"]:
            known |= {
                "cluster": values["cluster"]["address"],
                "cluster_workers": values["cluster"]["workers"],
            }
        return known | {name: values[name] or "" for name in ("environment", "environment_id")}

    @property
    def stop_timeout_s(self) -> float:
        """Time to end a step, to write the last files, and to send the last metrics."""
        return SAVE_S + CLOSE_S + STOP_MARGIN_S

    @model_validator(mode="after")
    def _can_be_recorded(self) -> Self:
        if not self.TRACKED and self.tracking.names:
            name = self.tracking.names[0]
            raise FieldError(
                name,
                f"{name} records trainings only; the results of an evaluation stay in its folder",
                remedy=f"remove {name}",
            )
        if self.launching:
            self.tracking.require()
        return self

    @model_validator(mode="after")
    def _continues_a_run(self) -> Self:
        run = Path(self.resume_run)
        if not self.resume_run or (run / "run.json").is_file():
            return self
        there = [found.parent.name for found in run.parent.glob("*/run.json")]
        raise FieldError(
            f"{self.BLOCK}.resume_run",
            f"There is no run {run.name!r} in {run.parent}: a run is a folder with a run.json",
            allowed=[str(run.parent / name) for name in nearest_first(run.name, there)[:3]],
            remedy="name the folder that a run logs at its start, or remove resume_run",
        )

    @model_validator(mode="after")
    def _has_a_usable_cluster(self) -> Self:
        if not self.cluster:
            return self
        if not self.SPREADS:
            raise FieldError(
                "cluster",
                "A cluster shares the rollouts of PPO with BACKEND_MUJOCO, the updates of METHOD_IMITATION, "
                "and the episodes of an evaluation in simulation; it has no effect here",
                remedy="remove it",
            )
        if self.environment == "ENV_REAL":
            raise FieldError(
                "cluster",
                "With ENV_REAL, this run drives a robot, and whoever reaches a cluster can run code in it",
                remedy="remove it, or write environment: ENV_SIMULATION in training",
            )
        try:
            check_address("ray", self.cluster)
        except JobError as error:
            raise FieldError("cluster.address", str(error)) from error
        return self
