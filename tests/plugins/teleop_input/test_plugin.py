"""What the plugin declares, and what it does not import."""

from __future__ import annotations

import subprocess
import sys

import pytest
from joshua.plugins import PluginStatus, SensorSpec, load_registry
from joshua.plugins.targets import check_targets


@pytest.mark.parametrize(
    ("block", "value"),
    [("gamepad_config", "PERCEPTION_GAMEPAD"), ("keyboard_config", "PERCEPTION_KEYBOARD")],
)
def test_the_specs_are_good(block: str, value: str) -> None:
    registry = load_registry()
    (row,) = (row for row in registry.rows() if row.distribution == "joshua-teleop-input")
    assert row.status is PluginStatus.OK, row.reasons
    spec = registry.find(SensorSpec, block, value)
    assert spec is not None
    assert check_targets(spec) == []
    assert spec.terminal is (block == "keyboard_config")


def test_listing_and_settings_import_nothing_heavy() -> None:
    program = (
        "import sys; from joshua.plugins import load_registry; load_registry(); "
        "import joshua_teleop_input.settings; "
        "print([name for name in ('pygame', 'numpy', 'termios', 'zenoh') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
