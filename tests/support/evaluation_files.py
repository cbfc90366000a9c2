"""Files that evaluate a checkpoint."""

from __future__ import annotations

from pathlib import Path


def write_evaluation(
    folder: Path,
    checkpoint: Path | str,
    more: str = "",
    *,
    head: str = "environment: ENV_SIMULATION simulator_backend: BACKEND_MUJOCO",
    environment: str = 'environment_id: "joshua/SoArm100Reach-v0"',
    episodes: int = 3,
    seed: str = "",
) -> Path:
    """Writes ``evaluate.pbtxt``; the block ``eval_config`` stands in line 9."""
    path = folder / "evaluate.pbtxt"
    path.write_text(f"""general {{ mode: MODE_TRAINING name: "evaluate" id: "evaluate-test" }}
simulation {{ mode: OFFSCREEN model_path: "so_arm100/reach.xml" {seed} }}
ai {{
  training {{
    {head}
    method: METHOD_EVAL
    {environment}
    eval_config {{
      model_checkpoint: "{checkpoint}"
      num_episodes: {episodes}
      {more}
    }}
  }}
}}
""")
    return path
