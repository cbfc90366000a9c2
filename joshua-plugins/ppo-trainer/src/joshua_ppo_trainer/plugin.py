"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, TrainerSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the trainer, and the model that runs its policies."""
    return [
        ModelSpec(
            block="joshua.PpoPolicy",
            message_module="joshua_ppo_trainer.ppo_pb2",
            enum_values=("MODEL_PLUGIN",),
            implementation="joshua_ppo_trainer.acting:PpoModel",
            settings="joshua_ppo_trainer.acting_settings:PpoPolicySettings",
            summary="policies trained by joshua-ppo-trainer, without PyTorch",
            packaged_files="joshua_ppo_trainer.shipped:find_packaged",
        ),
        TrainerSpec(
            block="training",
            # METHOD_RL chooses the trainer if no simulator is named, which is on a robot
            enum_values=("BACKEND_MUJOCO", "METHOD_RL"),
            implementation="joshua_ppo_trainer.node:PpoTrainer",
            settings="joshua_ppo_trainer.settings:TrainerSettings",
            summary="PPO and SAC on the CPU, in batched MuJoCo environments",
        ),
    ]
