"""The public names for authors of plugins: devices, models, services, and how a plugin describes them.

Names are imported at first use, so a plugin's description that takes its specs from here stays light. What
fewer plugins need is in the modules of this package: ``calibration``, ``clocks``, ``emulation``, ``files``,
``models``, ``modes``, ``motions``, ``nodes``, ``patience``, ``schema``, ``simulation``, ``specs``, ``texts``
and ``transports``. The other public modules are ``joshua.features`` (observations and actions),
``joshua.messages`` (ROS 2 messages), ``joshua.testing`` (the conformance kit) and ``joshua.tools`` (load,
check, plan, and the client of a running system).
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

#: The names of ``__init__.pyi`` by the heading that the reference lists them under, and by their module.
SECTIONS = sections(__file__)

__getattr__, __dir__ = lazy_names(__name__, *SECTIONS.values())
