"""For editors, dashboards, scripts and the commands of plugins: load, check, plan, explain, hold nodes.

Nothing is imported before it is used. ``check(path)`` finds every problem of a file, ``plan(path)`` says what
it starts, ``explain(name)`` documents a field. ``check_file`` and ``finish`` do the same in two steps, for a
program that changes the configuration between them. ``RunningSystem`` finds what runs, calls its nodes and
receives its ``events``; ``foreground_job`` lets a program hold nodes of a robot as a run does. A command of a
plugin takes its options, its exit codes and its emulators from here.
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

#: The names of ``__init__.pyi`` by the heading that the reference lists them under, and by their module.
SECTIONS = sections(__file__)

__getattr__, __dir__ = lazy_names(__name__, *SECTIONS.values())
