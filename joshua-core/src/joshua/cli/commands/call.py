"""``joshua call``: call a verb of a node in a running system, or list the verbs."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config, add_format, add_timeout
from joshua.cli.running import SYSTEM, explain, find_node, running_systems

if TYPE_CHECKING:
    import argparse

    from joshua.ipc.client import RunningSystem


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("node", nargs="?", default="", metavar="NODE", help="omitted lists every node")
    parser.add_argument("verb", nargs="?", default="", metavar="VERB", help="omitted lists those of the node")
    parser.add_argument(
        "fields",
        nargs="*",
        metavar="FIELD=VALUE",
        help="of the request, such as count=10 or joints.gripper=0.5; or one JSON object",
    )
    add_config(parser, f"{SYSTEM}, if several have the node")
    add_timeout(parser, "how long to wait for the reply (default 10)", 10.0)
    parser.add_argument("--start", action="store_true", help="start the node first if it has ended")
    add_format(parser)


def run(args: argparse.Namespace) -> int:
    """Call or list; exit code 0, 1 if the call failed or no system runs, 2 if the command line is wrong."""
    from joshua.ipc.client import CallError

    try:
        systems = running_systems(args.config or "")
        if not args.node:
            return _list([(system, node) for system in systems for node in system.info.nodes], args)
        system, node = find_node(args.node, systems)
        if not args.verb:
            return _list([(system, node)], args)
        payload = _payload(args.fields)
        reply = system.call(node, args.verb, payload, timeout_s=args.timeout, start=args.start)
    except CallError as error:
        return explain("call", error)
    if args.format == "json":
        sys.stdout.write(json.dumps(reply, indent=2) + "\n")
    else:
        sys.stdout.write("".join(f"{line}\n" for line in _reply_lines(reply)))
    return ExitCode.OK


def _payload(words: list[str]) -> dict[str, Any]:
    """The request; a value is JSON if it begins like an object, a list or a string, else it is text.

    Raises:
        CallError: a word is neither FIELD=VALUE nor a JSON object.
    """
    from joshua.ipc.client import CallError

    if len(words) == 1 and words[0].lstrip().startswith("{"):
        return dict(_json(words[0]))
    payload: dict[str, Any] = {}
    for word in words:
        path, equals, text = word.partition("=")
        name, _, key = path.partition(".")
        if not (name and equals):
            raise CallError(
                "invalid", f"{word!r}: expected FIELD=VALUE, such as count=10, or one JSON object"
            )
        value = _json(text) if text[:1] in ("{", "[", '"') or text == "null" else text
        if not key:
            payload[name] = value
        elif isinstance(inner := payload.setdefault(name, {}), dict):
            inner[key] = value
    return payload


def _json(text: str) -> Any:
    from joshua.ipc.client import CallError
    from joshua.plan.json_text import parse_json

    try:
        return parse_json(text)
    except ValueError as error:
        raise CallError("invalid", f"{text!r} is not JSON: {error}") from None


def _list(nodes: list[tuple[RunningSystem, str]], args: argparse.Namespace) -> int:
    """List nodes and their verbs; a node that does not respond is also listed."""
    from joshua.ipc.client import CallError

    rows: list[dict[str, Any]] = []
    for system, node in nodes:
        row: dict[str, Any] = {"system": system.info.process_id, "node": node, "verbs": []}
        try:
            verbs = system.verbs(node, timeout_s=min(args.timeout, 2.0))
            row["verbs"] = [info.model_dump() for info in verbs]
        except CallError as error:
            row["error"] = str(error)
        rows.append(row)
    if args.format == "json":
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
        return ExitCode.OK
    from joshua.supervisor.tables import Screen

    screen = Screen.of(sys.stdout)
    for row in rows:
        lines = [row["error"]] if "error" in row else [verb_line(info) for info in row["verbs"]]
        wrapped = (piece for line in lines for piece in screen.wrap(f"  {line}", indent=6))
        sys.stdout.writelines(f"{line}\n" for line in (row["node"], *wrapped))
    return ExitCode.OK


def verb_line(info: dict[str, Any]) -> str:
    """A verb with its fields: ``step [count:integer=1]  does some steps``."""
    request = info["request"]
    words = [info["name"]]
    for name, field in request.get("properties", {}).items():
        text = f"{name}:{_type_text(field)}"
        required = name in request.get("required", ())
        words.append(text if required else f"[{text}={json.dumps(field.get('default'))}]")
    return f"{' '.join(words)}  {info['summary']}{' (local only)' * info['moves']}"


def _type_text(field: dict[str, Any]) -> str:
    if "enum" in field:
        return "|".join(map(str, field["enum"]))
    low, high = field.get("minimum", ""), field.get("maximum", "")
    limits = f"({low}…{high})" if "minimum" in field or "maximum" in field else ""
    return f"{field.get('type', 'value')}{limits}"


def _reply_lines(reply: dict[str, Any]) -> list[str]:
    if not reply:
        return ["done"]
    if list(reply) == ["text"]:
        return [str(reply["text"])]
    return [f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in reply.items()]
