"""``joshua call``: ask a node of a running system for one of its verbs."""

from __future__ import annotations

import argparse
import difflib
import json
import sys
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import positive_seconds

if TYPE_CHECKING:
    from joshua.ipc.client import RunningSystem

SUMMARY = "ask a node of a running system for something, or list what can be asked"

#: What the user can mend in the command itself.
_INVALID = ("unknown-node", "unknown-verb", "invalid")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the command."""
    parser.add_argument("node", nargs="?", default="", metavar="NODE", help="omitted lists every node")
    parser.add_argument("verb", nargs="?", default="", metavar="VERB", help="omitted lists those of the node")
    parser.add_argument(
        "fields",
        nargs="*",
        metavar="FIELD=VALUE",
        help="of the request, such as count=10 or joints.gripper=0.5; or one JSON object",
    )
    parser.add_argument(
        "--system",
        default="",
        help="file or process id as `joshua status` shows it, where several have the node",
    )
    parser.add_argument(
        "--timeout",
        type=positive_seconds,
        default=10.0,
        metavar="SECONDS",
        help="how long to wait for the reply",
    )
    parser.add_argument("--start", action="store_true", help="start the node first where it stays down")
    parser.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="form of the output"
    )


def run(args: argparse.Namespace) -> int:
    """Calls or lists; exit code 0, 1 if the call failed or nothing runs, 2 if it cannot be understood."""
    from joshua.ipc.client import CallError, RunningSystem

    try:
        systems = [RunningSystem.find(args.system)] if args.system else RunningSystem.all()
        if not systems:
            raise CallError("unreachable", "nothing runs: joshua --config FILE starts a robot")
        if not args.node:
            return _list(systems, args)
        found = _systems_with(args.node, systems)
        if len(found) != 1:
            known = [name for item in systems for name in item.info.nodes]
            say_which("call", "node", args.node, known, several=bool(found))
            return ExitCode.INVALID
        if not args.verb:
            return _list(found, args)
        payload = _payload(args.fields)
        reply = found[0].call(args.node, args.verb, payload, timeout_s=args.timeout, start=args.start)
    except CallError as error:
        lines = [f"joshua call: {error}"] + [f"  allowed: {', '.join(error.allowed)}"] * bool(error.allowed)
        sys.stderr.write("\n".join(lines) + "\n")
        return ExitCode.INVALID if error.code in _INVALID else ExitCode.FAILED
    if args.format == "json":
        sys.stdout.write(json.dumps(reply, indent=2) + "\n")
    else:
        sys.stdout.write("".join(f"{line}\n" for line in _reply_lines(reply)))
    return ExitCode.OK


def say_which(command: str, what: str, word: str, known: list[str], *, several: bool) -> None:
    """Says on standard error that a word names no node, or several."""
    problem = f"several {what}s are" if several else f"no {what} is"
    remedy = ": give the full name, or --system" if several and command == "call" else ""
    lines = [f"joshua {command}: {problem} called {word!r}{remedy}"]
    near = difflib.get_close_matches(word.lstrip("/"), [name.lstrip("/") for name in known], n=1)
    if near and not several:
        lines.append(f"  nearest: {near[0]}")
    lines.append(f"  allowed: {', '.join(known) or f'none: no running system has an {what}'}")
    sys.stderr.write("\n".join(lines) + "\n")


def _systems_with(word: str, systems: list[RunningSystem]) -> list[RunningSystem]:
    """A system for each node that a word means; those with the same full name run in several domains."""
    from joshua.ipc.client import is_named

    return [item for item in systems for name in item.info.nodes if is_named(name, word)]


def _payload(words: list[str]) -> dict[str, Any]:
    """The request; a value is JSON where it begins like an object, a list or a string, else it is text.

    Raises:
        CallError: a word is neither FIELD=VALUE nor an object.
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

    try:
        return json.loads(text)
    except ValueError as error:
        raise CallError("invalid", f"{text!r} is no JSON: {error}") from None


def _list(systems: list[RunningSystem], args: argparse.Namespace) -> int:
    """Lists nodes and verbs; a node that does not answer is a row as well."""
    from joshua.ipc.client import CallError, is_named

    rows: list[dict[str, Any]] = []
    for system in systems:
        for node in system.info.nodes:
            if args.node and not is_named(node, args.node):
                continue
            row: dict[str, Any] = {"system": system.info.process_id, "node": node}
            try:
                verbs = system.verbs(node, timeout_s=min(args.timeout, 2.0))
                rows.append({**row, "verbs": [info.model_dump() for info in verbs]})
            except CallError as error:
                rows.append({**row, "verbs": [], "error": str(error)})
    if args.format == "json":
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
        return ExitCode.OK
    for row in rows:
        sys.stdout.write(f"{row['node']}\n" + (f"  {row['error']}\n" if "error" in row else ""))
        sys.stdout.writelines(f"  {verb_line(info)}\n" for info in row["verbs"])
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
    name = str(field.get("type", "value"))
    low, high = field.get("minimum"), field.get("maximum")
    limits = (
        ""
        if low is None and high is None
        else f"({'' if low is None else low}…{'' if high is None else high})"
    )
    return "|".join(map(str, field["enum"])) if "enum" in field else name + limits


def _reply_lines(reply: dict[str, Any]) -> list[str]:
    if not reply:
        return ["done"]
    if list(reply) == ["text"]:
        return [str(reply["text"])]
    return [f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in reply.items()]
