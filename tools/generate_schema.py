"""Regenerates everything that is derived from proto files; ``--check`` only says whether it is up to date.

Derived are, in ``joshua-core/src/joshua/schema``: the compiled modules and their type stubs, the comments
beside them, and the table of ROS 2 type names. The links there to the proto files, by which plugins import
them, are checked too. The protos of plugins and examples are compiled beside their sources.

Run it by ``nox -s proto``: generated code needs a protobuf at least as new as its compiler, so that session
has the oldest compiler that we support.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROTOS = ROOT / "proto"
CORE = ROOT / "joshua-core" / "src"
SCHEMA = CORE / "joshua" / "schema"
IMPORT_PATH = "joshua/schema"
DERIVED = ("*_pb2.py", "*_pb2.pyi", "*_pb2.comments.json", "data_type_names.py")
PLUGIN_PROTOS = ("joshua-plugins/*/src/*/*.proto", "docs/examples/*/src/*/*.proto")
_ROS_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")
_NUMBER = re.compile(r"^ +(?P<name>[A-Z][A-Z0-9_]*) = (?P<number>\d+);", re.MULTILINE)


def generate(schema: Path) -> None:
    """Writes all derived files into a folder, which stands for ``joshua/schema``."""
    sys.path.insert(0, str(CORE))
    from joshua.schema.compile import compile_protos

    protos = sorted(PROTOS.glob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        names = [f"{IMPORT_PATH}/{proto.name}" for proto in protos]
        for path in compile_protos(names, [f"{IMPORT_PATH}={PROTOS}"], Path(folder)):
            (schema / path.name).write_bytes(path.read_bytes())
    comments = json.loads((schema / "data_type_pb2.comments.json").read_text(encoding="utf-8"))
    text = (PROTOS / "data_type.proto").read_text(encoding="utf-8")
    (schema / "data_type_names.py").write_text(type_name_module(text, comments), encoding="utf-8")


def type_name_module(proto: str, comments: dict[str, str]) -> str:
    """Makes the table of ROS 2 type names from the enum's numbers and the comments of its values."""
    names: dict[int, str] = {}
    for match in _NUMBER.finditer(proto):
        found = _ROS_TYPE.match(comments.get(f"joshua.DataType.{match['name']}", ""))
        if found is not None:
            names.setdefault(int(match["number"]), found.group())
    rows = "".join(f'    {number}: "{name}",\n' for number, name in sorted(names.items()))
    head = '"""ROS 2 type names by DataType number. Generated from ``data_type.proto``; do not edit."""'
    return f"{head}\n\nTYPE_NAMES: dict[int, str] = {{\n{rows}}}\n"


def derived_files(schema: Path) -> dict[str, bytes]:
    """Reads the derived files of a folder by name."""
    return {path.name: path.read_bytes() for pattern in DERIVED for path in schema.glob(pattern)}


def wanted_files() -> dict[str, bytes]:
    """Makes the derived files afresh; a proto that does not compile leaves those of the repository alone."""
    with tempfile.TemporaryDirectory() as folder:
        generate(Path(folder))
        return derived_files(Path(folder))


def replace_derived(schema: Path, wanted: dict[str, bytes]) -> None:
    """Writes the derived files into a folder, and removes those of protos that are gone."""
    for name in derived_files(schema).keys() - wanted.keys():
        (schema / name).unlink()
    for name, content in wanted.items():
        (schema / name).write_bytes(content)
    for link in schema.glob("*.proto"):
        link.unlink()
    for proto in sorted(PROTOS.glob("*.proto")):
        (schema / proto.name).symlink_to(Path(os.path.relpath(PROTOS, schema)) / proto.name)


def plugin_files() -> dict[Path, bytes]:
    """Makes the modules of plugins and examples afresh, by the path of the committed file."""
    sys.path.insert(0, str(CORE))
    from joshua.schema.compile import PACKAGE_ROOT, compile_protos, import_root

    wanted: dict[Path, bytes] = {}
    for proto in sorted(path for pattern in PLUGIN_PROTOS for path in ROOT.glob(pattern)):
        root = import_root(proto)
        name = proto.relative_to(root).as_posix()
        with tempfile.TemporaryDirectory() as folder:
            for path in compile_protos([name], [str(root), str(PACKAGE_ROOT)], Path(folder)):
                wanted[root / path.relative_to(folder)] = path.read_bytes()
    return wanted


def stale_plugin_files() -> list[str]:
    """Names the committed files of plugins and examples that differ from what their protos give."""
    return [
        f"{path.relative_to(ROOT)} is stale"
        for path, content in plugin_files().items()
        if not path.is_file() or path.read_bytes() != content
    ]


def stale_files() -> list[str]:
    """Names the committed files of the schema that differ from what the protos give, with the reason."""
    wanted, present = wanted_files(), derived_files(SCHEMA)
    faults = [f"{name} is missing" for name in wanted.keys() - present.keys()]
    faults += [f"{name} has no proto file" for name in present.keys() - wanted.keys()]
    faults += [f"{name} is stale" for name in wanted.keys() & present.keys() if wanted[name] != present[name]]
    protos = {path.name for path in PROTOS.glob("*.proto")}
    faults += [
        f"{name} is no link to proto/{name}"
        for name in protos ^ {path.name for path in SCHEMA.glob("*.proto") if path.resolve().parent == PROTOS}
    ]
    return sorted(faults)


def main() -> int:
    """Generates or checks; 0 when the committed files are up to date."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="change nothing; fail when a file is stale")
    if parser.parse_args().check:
        faults = [f"{SCHEMA.relative_to(ROOT)}: {fault}" for fault in stale_files()] + stale_plugin_files()
        for fault in faults:
            sys.stderr.write(f"{fault}\n")
        if faults:
            sys.stderr.write("Run `nox -s proto` and commit the result.\n")
        return 1 if faults else 0
    replace_derived(SCHEMA, wanted_files())
    for path, content in plugin_files().items():
        path.write_bytes(content)
    return 0


if __name__ == "__main__":
    sys.exit(main())
