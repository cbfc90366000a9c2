"""A window with the newest picture of a sensor, for the nodes of cameras and scanners."""

from joshua_preview.preview import Pixels, Preview, display_problem

__all__ = ["Pixels", "Preview", "display_problem"]
