"""Texts of configurations with a simulation, for the tests of this folder."""

from __future__ import annotations

ARM = 'actuators: ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]'


def simulation_file(
    *, simulation: str = "", arm: str = ARM, camera: str = "top", mode: str = "OFFSCREEN", size: str = "64"
) -> str:
    """An arm and a camera of a model; ``simulation`` are further lines of that block."""
    return f"""
general {{ mode: MODE_SIMULATION name: "sim" id: "sim-test" }}
simulation {{
  mode: {mode}
  model_path: "so_arm100/scene.xml"
  {simulation}
}}
robot {{
  actions {{
    node {{
      node_name: "arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }}
    }}
    action_type: ACTION_SINGLE
    sim_config {{ {arm} }}
  }}
  perceptions {{
    node {{
      node_name: "camera" node_id: 2
      publishers {{ data_type: IMAGE topic_name: "/camera/image_raw" publish_rate_hz: 20 }}
    }}
    perception_type: PERCEPTION_CAMERA
    sim_camera_config {{ camera: "{camera}" width: {size} height: 48 fps: 20 }}
  }}
}}
"""
