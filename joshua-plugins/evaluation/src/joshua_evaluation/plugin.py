"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.api import PluginSpec, TrainerSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the evaluation."""
    return [
        TrainerSpec(
            block="training",
            enum_values=("METHOD_EVAL",),
            implementation="joshua_evaluation.node:Evaluation",
            settings="joshua_evaluation.settings:EvaluationSettings",
            summary="evaluates trained policies and models in simulated episodes",
        )
    ]
