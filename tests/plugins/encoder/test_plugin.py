"""What the plugin declares, and what it does not import."""

from __future__ import annotations

import subprocess
import sys

from joshua.plugins import PluginStatus, SensorSpec, load_registry
from joshua.plugins.targets import check_targets


def test_the_spec_is_good() -> None:
    registry = load_registry()
    (row,) = (row for row in registry.rows() if row.distribution == "joshua-encoder")
    assert row.status is PluginStatus.OK, row.reasons
    spec = registry.find(SensorSpec, "encoder_config", "PERCEPTION_ENCODER")
    assert spec is not None
    assert check_targets(spec) == []


def test_listing_and_settings_import_nothing_heavy() -> None:
    program = (
        "import sys; from joshua.plugins import load_registry; load_registry(); "
        "import joshua_encoder.settings; "
        "print([name for name in ('numpy', 'zenoh') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
