"""Files of small trainings for a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import Any

REACH = "joshua/SoArm100Reach-v0"


def write_training(folder: Path, cluster: str = "", **fields: Any) -> Path:
    """Writes a file that trains for a moment."""
    known = {
        "algorithm": '"PPO"',
        "num_envs": 6,
        "total_timesteps": 480,
        "learning_rate": 0.003,
        "gamma": 0.9,
        "batch_size": 16,
        "n_steps": 8,
        "n_epochs": 2,
        "normalize_observations": "true",
        "normalize_rewards": "true",
    }
    block = " ".join(f"{name}: {value}" for name, value in (known | fields).items())
    path = folder / "train.pbtxt"
    path.write_text(f"""general {{ mode: MODE_TRAINING name: "train" id: "train-on-ray" }}
simulation {{ mode: OFFSCREEN model_path: "so_arm100/reach.xml" seed: 3 }}
ai {{
  training {{
    environment: ENV_SIMULATION simulator_backend: BACKEND_MUJOCO
    method: METHOD_RL
    environment_id: "{REACH}"
    {cluster}
    rl_config {{ {block} }}
  }}
}}
""")
    return path


IMITATION = """
general {{ mode: MODE_TRAINING name: "train" id: "train-together" }}
ai {{
  data_store {{
    format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "demos" local_path: "{dataset}"
  }}
  training {{
    environment: ENV_SIMULATION method: METHOD_IMITATION {cluster}
    imitation_config {{ {block} }}
  }}
}}
"""


def write_imitation(folder: Path, dataset: Path, cluster: str = "", **fields: Any) -> Path:
    """Writes a file that trains a small ACT on the CPU."""
    known = {
        **{"dataset_name": '"demos"', "num_epochs": 1, "learning_rate": 0.001, "batch_size": 4},
        **{"chunk_size": 8, "hidden_size": 32, "feedforward_size": 32, "encoder_layers": 1},
        **{"report_steps": 1, "validation_steps": 4, "checkpoint_steps": 4, "threads": 1, "device": '"cpu"'},
    }
    block = " ".join(f"{name}: {value}" for name, value in (known | fields).items())
    path = folder / "train.pbtxt"
    path.write_text(IMITATION.format(dataset=dataset, cluster=cluster, block=block))
    return path
