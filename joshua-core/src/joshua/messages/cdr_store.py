"""A store of message definitions that compiles codecs for CDR alone, and classes when they are used."""

from __future__ import annotations

import builtins
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.machinery import PathFinder
from types import SimpleNamespace
from typing import Any

import rosbags.typesys.stores
from rosbags.interfaces import Msgdef
from rosbags.serde import cdr
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from joshua.messages.cdr import NATIVE_LE


class CdrStore(Typestore):
    """Compiles a third of the code that the base class compiles, which also converts from and to ROS 1.

    Every process compiles the codecs of its types while it starts.

    Args:
        name: module of ``rosbags.typesys.stores`` that holds the definitions, such as ``ros2_jazzy``.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        module = _definitions(name)
        self.fielddefs.update(module.FIELDDEFS)
        self.types.update({key: getattr(module, key.replace("/", "__")) for key in module.FIELDDEFS})

    def class_of(self, typename: str) -> Any:
        """The class of a type, which becomes a dataclass at the first call."""
        found: Any = self.types[typename]
        return found if "__dataclass_fields__" in vars(found) else dataclass(found)

    def get_msgdef(self, typename: str) -> Msgdef[Any]:
        """Return the codecs of a type, compiled at the first call."""
        if typename not in self.cache:
            fields = [(normalize_fieldname(name), kind) for name, kind in self.fielddefs[typename][1]]
            getsize, size = cdr.generate_getsize_cdr(fields, self)
            write = cdr.generate_serialize_cdr(fields, self, "le" if NATIVE_LE else "be")
            unused: Any = None
            self.cache[typename] = Msgdef(
                name=typename,
                fields=fields,
                cls=self.class_of(typename),
                size_cdr=size,
                getsize_cdr=getsize,
                serialize_cdr_le=write,
                serialize_cdr_be=write,
                deserialize_cdr_le=cdr.generate_deserialize_cdr(fields, self, "le"),
                deserialize_cdr_be=cdr.generate_deserialize_cdr(fields, self, "be"),
                size_ros1=0,
                getsize_ros1=unused,
                serialize_ros1=unused,
                deserialize_ros1=unused,
                getsize_ros1_to_cdr=unused,
                ros1_to_cdr=unused,
                getsize_cdr_to_ros1=unused,
                cdr_to_ros1=unused,
            )
        return self.cache[typename]


@cache
def _definitions(name: str) -> Any:
    """A private copy of a module of definitions, whose classes are not dataclasses yet.

    The module makes 160 dataclasses, which costs every process 30 ms; a run uses ten of them. The copy leaves
    the module itself alone, which other packages in this process may use.
    """
    spec = PathFinder.find_spec(f"rosbags.typesys.stores.{name}", rosbags.typesys.stores.__path__)
    loader: Any = spec and spec.loader
    scope = {"__name__": __name__, "__builtins__": {**vars(builtins), "__import__": _import}}
    exec(loader.get_code(f"rosbags.typesys.stores.{name}"), scope)  # noqa: S102 (a module of a dependency)
    return SimpleNamespace(**scope)


def _import(
    name: str,
    scope: Mapping[str, object] | None = None,
    names: Mapping[str, object] | None = None,
    wanted: Sequence[str] = (),
    level: int = 0,
) -> Any:
    """Serves the import statements of a copied module: its bases are copies, too."""
    if name == "dataclasses":
        return SimpleNamespace(dataclass=lambda made: made)
    if level:
        return SimpleNamespace(**{base: _definitions(base) for base in wanted})
    return __import__(name, scope, names, wanted)
