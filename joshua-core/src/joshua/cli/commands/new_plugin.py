"""``joshua new-plugin``: write a distribution with a working driver to start from."""

from __future__ import annotations

import keyword
import re
import sys
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

#: The kinds of plugins, and the device that each driver simulates. The templates are beside this file.
KINDS = {"actuator": "an actuator with one joint", "sensor": "a sensor that measures a distance"}

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z][a-z0-9]*)*")
_FILE = re.compile(r"^=== (.+)\n", re.MULTILINE)
_FIELD = re.compile(r"^  (optional )?float (\w+) = (\d+) \[\(joshua.rule\) = \{(.*)\}\];$", re.MULTILINE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua new-plugin``."""
    parser.add_argument(
        "name", metavar="NAME", help="name of the distribution and its folder, such as acme-hand"
    )
    parser.add_argument("--kind", choices=tuple(KINDS), default="actuator", help="kind of device (actuator)")


def run(arguments: argparse.Namespace) -> int:
    """Write the distribution into the current folder and say what to do next."""
    name = arguments.name
    if not _NAME.fullmatch(name):
        return _refuse(
            f"{name!r} is not a valid name", "allowed: lower-case words joined by -, such as acme-hand"
        )
    taken = {"joshua", "google", *sys.stdlib_module_names, *keyword.kwlist}
    if name.partition("-")[0] in taken:
        return _refuse(
            f"{name!r} begins with a name that is taken", "begin it with your own, such as acme-hand"
        )
    target = Path(name)
    try:
        target.mkdir()
        for path, text in files_of(name, arguments.kind).items():
            (target / path).parent.mkdir(parents=True, exist_ok=True)
            (target / path).write_text(text, encoding="utf-8")
    except FileExistsError:
        return _refuse(f"{target} exists already, so nothing was written", "choose another name")
    except OSError as error:
        return _refuse(f"{target} cannot be written: {error.strerror}", "check the folder's permissions")
    sys.stdout.write(
        f"{target} written: {KINDS[arguments.kind]}, simulated by its driver\n"
        f"  install: pip install -e './{target}[test]'\n"
        f"  test:    pytest {target}/tests\n"
        "  check:   joshua plugins --check\n"
        f"  run:     joshua --config {target}/robot.pbtxt\n"
        f"  change:  {target}/README.md says what is where\n"
    )
    return ExitCode.OK


def files_of(name: str, kind: str = "actuator") -> dict[str, str]:
    """Return the files of a distribution by their path in it."""
    vendor, _, device = name.partition("-")
    device = (device or vendor).replace("-", "_")
    names = {"name": name, "package": name.replace("-", "_"), "vendor": vendor, "device": device}
    names |= {"Class": "".join(word.capitalize() for word in device.split("_"))}
    names |= {"kind": kind, "what": KINDS[kind], "serialized": ""}
    sources = [Path(__file__).with_name(f"new_plugin{of}.template") for of in ("", f"_{kind}")]
    template = Template("".join(source.read_text(encoding="utf-8") for source in sources))
    names["serialized"] = repr(_compiled(names, template.substitute(names)))
    _, *parts = _FILE.split(template.substitute(names))
    return dict(zip(parts[::2], parts[1::2], strict=True))


def _compiled(names: dict[str, str], text: str) -> bytes:
    """Return the descriptor of the proto file in a text; the compiler may not be installed."""
    from google.protobuf import text_format
    from google.protobuf.descriptor_pb2 import FileDescriptorProto

    from joshua.schema import options_pb2

    rule_option: Any = options_pb2.rule
    file = FileDescriptorProto(name=f"{names['package']}/{names['device']}.proto", package=names["vendor"])
    file.dependency.append("joshua/schema/options.proto")
    file.syntax = "proto3"
    message = file.message_type.add(name=f"{names['Class']}Config")
    for is_optional, name, number, rule in _FIELD.findall(text):
        field = message.field.add(name=name, number=int(number), label="LABEL_OPTIONAL", type="TYPE_FLOAT")
        text_format.Parse(rule, field.options.Extensions[rule_option])
        if is_optional:
            field.oneof_index, field.proto3_optional = len(message.oneof_decl), True
            message.oneof_decl.add(name=f"_{name}")
    return file.SerializeToString(deterministic=True)


def _refuse(problem: str, hint: str) -> int:
    sys.stderr.write(f"joshua new-plugin: {problem}\n  {hint}\n")
    return ExitCode.INVALID
