"""Compiles proto files to Python modules with their comments: ``python -m joshua.schema.compile FILE.proto``.

For authors of plugins: the proto may ``import "joshua/schema/options.proto"`` and describe its fields by
the same rule option as the built-in blocks. Needs ``grpcio-tools``. Compiled modules need a protobuf at least
as new as their compiler, so an older compiler makes a plugin that fits more environments.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.schema.comments import SUFFIX

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from google.protobuf.descriptor_pb2 import FileDescriptorProto

#: The compiler whose modules run with every protobuf that JOSHUA supports.
COMPILER = "grpcio-tools<1.72"

# The folder from which "joshua/schema/options.proto" is found.
PACKAGE_ROOT = Path(__file__).resolve().parents[2]

# Components of source location paths: parts of a descriptor, and their field numbers in descriptor.proto.
_SYNTAX = 12
_PARTS = {
    "FileDescriptorProto": (("message_type", 4), ("enum_type", 5), ("extension", 7)),
    "DescriptorProto": (("field", 2), ("nested_type", 3), ("enum_type", 4), ("oneof_decl", 8)),
    "EnumDescriptorProto": (("value", 2),),
}


class CompileError(Exception):
    """A proto file cannot be compiled. The text is for the author of the file."""


def compile_protos(names: Sequence[str], search: Sequence[str], out: Path) -> list[Path]:
    """Compiles proto files.

    Args:
        names: of the files, as other files import them: ``acme_gripper/gripper.proto``.
        search: folders that names are looked up in, or ``virtual=folder`` pairs, as protoc takes them.
        out: root folder of the written modules, at the names' paths.

    Returns:
        The files written: for each name the module, its type stub and its comments.

    Raises:
        CompileError: if the compiler is not installed or refuses a file.
    """
    if importlib.util.find_spec("grpc_tools") is None:
        raise CompileError(
            f"grpcio-tools, which compiles proto files, is not installed: pip install '{COMPILER}'"
        )
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        descriptors = Path(folder, "descriptors.bin")
        command = [sys.executable, "-m", "grpc_tools.protoc"]
        command += [f"-I{entry}" for entry in search]
        command += [f"--python_out={out}", f"--pyi_out={out}"]
        command += [f"--descriptor_set_out={descriptors}", "--include_source_info", *names]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise CompileError(done.stderr.strip() or f"the compiler ended with status {done.returncode}")
        from google.protobuf.descriptor_pb2 import FileDescriptorSet

        files = {file.name: file for file in FileDescriptorSet.FromString(descriptors.read_bytes()).file}
    written: list[Path] = []
    for name in names:
        module = out / f"{name.removesuffix('.proto').replace('-', '_')}_pb2.py"
        table = module.with_suffix(SUFFIX)
        comments = json.dumps(comment_table(files[name]), ensure_ascii=False, indent=1)
        table.write_text(f"{comments}\n", encoding="utf-8")
        written += [module, module.with_suffix(".pyi"), table]
    return written


def comment_table(file: FileDescriptorProto) -> dict[str, str]:
    """Returns the comments of a file by full name; the key "" holds the one at its head."""
    names = {(_SYNTAX,): "", **dict(_names(file, (), file.package))}
    table: dict[str, str] = {}
    for location in file.source_code_info.location:
        name = names.get(tuple(location.path))
        if name is None:
            continue
        text = location.leading_comments or location.trailing_comments
        if not text and name == "" and location.leading_detached_comments:
            text = location.leading_detached_comments[0]
        if text.strip():
            table.setdefault(name, _reflow(text))
    return dict(sorted(table.items()))


def _names(item: Any, path: tuple[int, ...], name: str) -> Iterator[tuple[tuple[int, ...], str]]:
    """Paths and full names of a descriptor's elements."""
    for part, number in _PARTS.get(type(item).__name__, ()):
        for index, inner in enumerate(getattr(item, part)):
            inner_path, inner_name = (*path, number, index), f"{name}.{inner.name}".removeprefix(".")
            yield inner_path, inner_name
            yield from _names(inner, inner_path, inner_name)


def _reflow(text: str) -> str:
    """Joins the lines of a comment into paragraphs, which stay apart by an empty line."""
    paragraphs: list[list[str]] = [[]]
    for line in text.strip().split("\n"):
        if line.strip():
            paragraphs[-1].append(line.strip())
        elif paragraphs[-1]:
            paragraphs.append([])
    return "\n\n".join(" ".join(lines) for lines in paragraphs if lines)


def import_root(proto: Path) -> Path:
    """Return the import root of a proto's package: the first parent folder without ``__init__.py``."""
    folder = proto.resolve().parent
    while (folder / "__init__.py").is_file():
        folder = folder.parent
    return folder


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command. Return 0 if all files are compiled, 2 if one cannot be."""
    parser = argparse.ArgumentParser(
        prog="python -m joshua.schema.compile",
        description="Compile a plugin's proto file, with the comments that `joshua explain` shows.",
    )
    parser.add_argument("files", nargs="+", metavar="FILE.proto", help="proto file to compile")
    parser.add_argument(
        "--out", metavar="DIR", help="folder that modules are written below (default: beside the proto)"
    )
    parser.add_argument(
        "--root",
        metavar="DIR",
        help="folder that Python imports and proto imports start from (default: the first folder above "
        "the file that is no Python package)",
    )
    options = parser.parse_args(arguments)
    for file in options.files:
        proto = Path(file)
        if not proto.is_file():
            sys.stderr.write(f"{file} does not exist. Give the path of a .proto file.\n")
            return 2
        root = Path(options.root).resolve() if options.root else import_root(proto)
        if not proto.resolve().is_relative_to(root):
            sys.stderr.write(f"{file} is not below {root}. Give a --root that contains it.\n")
            return 2
        name = proto.resolve().relative_to(root).as_posix()
        out = Path(options.out) if options.out else root
        try:
            written = compile_protos([name], [str(root), str(PACKAGE_ROOT)], out)
        except CompileError as fault:
            sys.stderr.write(f"{file} cannot be compiled: {fault}\n")
            return 2
        for path in written:
            sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
