"""A store of message definitions that compiles codecs for CDR alone."""

from __future__ import annotations

from typing import Any

from rosbags.interfaces import Msgdef
from rosbags.serde import cdr
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from joshua.messages.cdr import NATIVE_LE


class CdrStore(Typestore):
    """Compiles a third of what the base class compiles, which also converts from and to ROS 1.

    Every process compiles the codecs of its types while it starts.
    """

    def get_msgdef(self, typename: str) -> Msgdef[Any]:
        """The codecs of a type, compiled at the first call."""
        if typename not in self.cache:
            fields = [(normalize_fieldname(name), kind) for name, kind in self.fielddefs[typename][1]]
            getsize, size = cdr.generate_getsize_cdr(fields, self)
            write = cdr.generate_serialize_cdr(fields, self, "le" if NATIVE_LE else "be")
            unused: Any = None
            self.cache[typename] = Msgdef(
                name=typename,
                fields=fields,
                cls=self.types[typename],
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
