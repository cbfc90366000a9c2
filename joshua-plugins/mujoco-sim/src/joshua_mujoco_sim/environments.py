"""The environments that this plugin offers, as data: naming them imports neither Gymnasium nor MuJoCo."""

from __future__ import annotations

from joshua.plugins.specs import Environment

ENVIRONMENTS = (
    Environment(
        "joshua/SoArm100Reach-v0", ("reach", "reach_sparse"), "the grip goes to a place in front of the arm"
    ),
    Environment(
        "joshua/SoArm100PickPlace-v0",
        ("pick_place", "pick_place_sparse"),
        "the cube goes onto the goal, and the jaw lets go",
    ),
    Environment("joshua/Ant-v0", ("forward",), "the ant runs along x"),
)
