"""``joshua models``: list the models that ``model_path`` accepts by name."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse

SUMMARY = "list the simulation models that come with JOSHUA, or show one"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua models``."""
    import argparse

    parser.add_argument(
        "model",
        nargs="?",
        help="name of a packaged model, or path of a file: show its joints, actuators and cameras",
    )
    parser.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="form of the list"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the list, or the content of one model. Exit code 0; 2 if a model cannot be loaded."""
    as_json = getattr(arguments, "format", "text") == "json"
    return _show(arguments.model, as_json) if arguments.model else _list(as_json)


def _list(as_json: bool) -> int:
    from joshua_mujoco_sim.catalog import PACKAGED_MODELS

    if as_json:
        rows = [{"name": m.name, "summary": m.summary, "mjx": m.mjx} for m in PACKAGED_MODELS]
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
        return 0
    width = max(len(model.name) for model in PACKAGED_MODELS)
    for model in PACKAGED_MODELS:
        sys.stdout.write(f"{model.name:<{width}}  {model.summary}\n")
        if model.mjx:
            sys.stdout.write(f"{'':<{width}}  for accelerators: {model.mjx}\n")
    return 0


def _show(name: str, as_json: bool) -> int:
    from joshua.tools import ExitCode, Screen

    from joshua_mujoco_sim.model_file import ModelError, load_model
    from joshua_mujoco_sim.summary import summarise

    try:
        facts = summarise(load_model(name))
    except ModelError as error:
        sys.stderr.write(f"joshua models: {error}\n")
        return ExitCode.INVALID
    if as_json:
        sys.stdout.write(json.dumps(facts, indent=2) + "\n")
        return 0
    screen = Screen.of(sys.stdout)
    for line in _text(name, facts).splitlines():
        sys.stdout.writelines(f"{piece}\n" for piece in screen.wrap(line, indent=4))
    return 0


def _text(name: str, facts: dict[str, Any]) -> str:
    lines = [f"{name}: {facts['mass_kg']:.3f} kg, time step {1000 * facts['timestep_s']:g} ms"]
    lines.append("joints:")
    width = max((len(joint["name"]) for joint in (*facts["joints"], *facts["drivable"])), default=0)
    for joint in facts["joints"]:
        limits = joint["range"]
        text = f"{limits[0]:+.3f} to {limits[1]:+.3f} {joint['unit']}" if limits else "no limit"
        lines.append(f"  {joint['name']:<{width}}  {joint['type']:<6} {text}")
    lines.append("can be driven, and what drives it:" if facts["drivable"] else "can be driven: none")
    for joint in facts["drivable"]:
        low, high = joint["range"]
        limits = f"{low:+.3f} to {high:+.3f} {joint['unit']}" + ("" if joint["limited"] else ", no limit")
        others = [name for name in joint["names"] if name != joint["name"]]
        also = f"; also named {', '.join(others)}" if others else ""
        lines.append(f"  {joint['name']:<{width}}  {limits}: {joint['driven_by']}{also}")
    if facts["not_drivable"]:
        lines.append("cannot be driven to a position:")
        lines += [f"  {one['name']} {one['reason']}" for one in facts["not_drivable"]]
    lines.append("cameras: " + (", ".join(filter(None, facts["cameras"])) or "none"))
    lines.append("keyframes: " + (", ".join(filter(None, facts["keyframes"])) or "none"))
    if facts["drivable"]:
        lines += ["", *_block(facts["drivable"])]
    return "\n".join(lines)


def _block(joints: list[dict[str, Any]]) -> list[str]:
    """Return the block of a configuration that drives these joints."""
    names = ",\n    ".join(json.dumps(joint["name"]) for joint in joints)
    lines = ["sim_config {", f"  actuators: [\n    {names}\n  ]"]
    looped = [joint for joint in joints if joint["kind"] != "position"]
    if looped:
        lines.append("  # optional, for joints that a position loop drives:")
        name = json.dumps(looped[0]["name"])
        lines.append(f"  # drives {{ joint: {name} position_gain: 40 velocity_gain: 2 }}")
    return [*lines, "}"]
