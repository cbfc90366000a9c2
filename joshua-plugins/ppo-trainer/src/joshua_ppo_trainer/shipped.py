"""The policies that ship with this plugin, by name."""

from __future__ import annotations

from pathlib import Path

#: Policy of the SO-ARM100 that reaches a goal, trained by ``training_rl_ppo.pbtxt``.
REACH = Path(__file__).with_name("reach")

_BY_NAME = {"joshua/so_arm100/reach": REACH}


def find_packaged(name: str) -> Path | None:
    """Return the folder of a policy that ships with this plugin; None if no policy has that name.

    Args:
        name: such as ``joshua/so_arm100/reach``.
    """
    return _BY_NAME.get(name)
