"""``joshua new-plugin``: write a distribution with a working driver, to be made your own."""

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

TEMPLATE = Path(__file__).with_suffix(".template")

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z][a-z0-9]*)*")
_FILE = re.compile(r"^=== (.+)\n", re.MULTILINE)
# What the compiler of protobuf makes of the proto file in the template: field, type of presence, rule.
_FIELDS = (
    ("stroke_m", False, 'unit: "m" above: 0 max: 0.5 required: true example: "0.08"'),
    ("finger_length_m", True, 'unit: "m" above: 0 max: 1 default: "0.1"'),
    ("speed_rad_s", True, 'unit: "rad/s" above: 0 max: 10 default: "2"'),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua new-plugin``."""
    parser.add_argument(
        "name", metavar="NAME", help="name of the distribution and its folder, such as acme-hand"
    )


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
        for path, text in files_of(name).items():
            (target / path).parent.mkdir(parents=True, exist_ok=True)
            (target / path).write_text(text, encoding="utf-8")
    except FileExistsError:
        return _refuse(f"{target} exists already, so nothing was written", "choose another name")
    except OSError as error:
        return _refuse(f"{target} cannot be written: {error.strerror}", "check the folder's permissions")
    sys.stdout.write(
        f"{target} written: an actuator whose driver simulates one joint\n"
        f"  install: pip install -e './{target}[test]'\n"
        f"  test:    pytest {target}/tests\n"
        "  check:   joshua plugins --check\n"
        f"  run:     joshua --config {target}/robot.pbtxt\n"
        f"  change:  {target}/README.md says what is where\n"
    )
    return ExitCode.OK


def files_of(name: str) -> dict[str, str]:
    """The files of a distribution by their path in it."""
    vendor, _, device = name.partition("-")
    device = (device or vendor).replace("-", "_")
    names = {"name": name, "package": name.replace("-", "_"), "vendor": vendor, "device": device}
    names["Class"] = "".join(word.capitalize() for word in device.split("_"))
    names["serialized"] = repr(_compiled(names))
    _, *parts = _FILE.split(Template(TEMPLATE.read_text(encoding="utf-8")).substitute(names))
    return dict(zip(parts[::2], parts[1::2], strict=True))


def _compiled(names: dict[str, str]) -> bytes:
    """The descriptor of the template's proto file, without the compiler, which need not be installed."""
    from google.protobuf import text_format
    from google.protobuf.descriptor_pb2 import FileDescriptorProto

    from joshua.schema import options_pb2

    rule_option: Any = options_pb2.rule
    file = FileDescriptorProto(name=f"{names['package']}/{names['device']}.proto", package=names["vendor"])
    file.dependency.append("joshua/schema/options.proto")
    file.syntax = "proto3"
    message = file.message_type.add(name=f"{names['Class']}Config")
    for number, (name, is_optional, rule) in enumerate(_FIELDS, 1):
        field = message.field.add(name=name, number=number, label="LABEL_OPTIONAL", type="TYPE_FLOAT")
        text_format.Parse(rule, field.options.Extensions[rule_option])
        if is_optional:
            field.oneof_index, field.proto3_optional = len(message.oneof_decl), True
            message.oneof_decl.add(name=f"_{name}")
    return file.SerializeToString(deterministic=True)


def _refuse(problem: str, hint: str) -> int:
    sys.stderr.write(f"joshua new-plugin: {problem}\n  {hint}\n")
    return ExitCode.INVALID
