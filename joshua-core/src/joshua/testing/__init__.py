"""The conformance kit for plugin authors and the pytest fixtures. Checks are loaded at first use.

``check_actuator(factory)``, ``check_sensor(factory)`` and ``check_model(factory)`` check a driver or model
against the contract of its base class, and raise ``ConformanceError`` with every clause that it violates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.testing.actuator_check import check_actuator as check_actuator
    from joshua.testing.conformance import ConformanceError as ConformanceError
    from joshua.testing.model_check import check_model as check_model
    from joshua.testing.recording_context import RecordingContext as RecordingContext
    from joshua.testing.sensor_check import check_sensor as check_sensor

_HOMES = {
    "check_actuator": "actuator_check",
    "check_model": "model_check",
    "check_sensor": "sensor_check",
    "ConformanceError": "conformance",
    "RecordingContext": "recording_context",
}
__all__ = ["ConformanceError", "RecordingContext", "check_actuator", "check_model", "check_sensor"]


def __getattr__(name: str) -> Any:
    """Import a name on first use: the pytest plugin stays light."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
