"""For editors, dashboards, scripts and the commands of plugins: load, check, plan, explain, reserve nodes.

Names are imported at first use. ``check(path)`` finds every problem of a file, ``plan(path)`` lists what it
starts, ``explain(name)`` documents a field. ``check_file`` and ``finish`` do the same in two steps, for a
program that changes the configuration between them. ``RunningSystem`` finds what runs, calls its nodes and
receives its ``events``; ``foreground_job`` reserves nodes of a robot for a program, as a run does. Commands
of plugins import their options, exit codes and emulators from here.
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

#: The names of ``__init__.pyi`` by the heading that the reference lists them under, and by their module.
SECTIONS = sections(__file__)

__getattr__, __dir__ = lazy_names(__name__, *SECTIONS.values())
