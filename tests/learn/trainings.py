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
