"""Random configuration texts in every spelling that the text format allows, and random damage to them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from hypothesis import strategies as st
from joshua.schema.config_pb2 import Config
from joshua.schema.descriptors import is_repeated
from third_party import URL, sample_class

_D = FieldDescriptor
_MOST_FIELDS = 4
_DEEPEST = 5
Draw = Callable[[st.SearchStrategy[Any]], Any]

GAPS = st.sampled_from(
    (" ", "  ", "\n", "\n\n", "\t", "\r\n", " # a comment\n", "\n# {[<\"' a comment\n\n", "\u00a0", "\n\v\f ")
)
_OPTIONAL_GAPS = st.one_of(st.just(""), GAPS)
_LIMITS = {
    _D.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
    _D.CPPTYPE_UINT32: (0, 2**32 - 1),
    _D.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
    _D.CPPTYPE_UINT64: (0, 2**64 - 1),
}
_SPECIAL_FLOATS = (
    "0 -0 1 50.0 1e6 -2.5E-3 .5 -.5 5. 1.5f 2f -3f inf -inf nan INF infinity -Infinity nanf inff "
    "1e400 3.4028236e38 1e-50 16777217 +1.5"
)
_FLOATS = st.one_of(
    st.sampled_from(_SPECIAL_FLOATS.split()),
    st.floats().map(repr),
    st.floats(width=32).map(repr),
    st.integers(-(10**20), 10**20).map(str),
)
_CHARACTERS = st.characters(exclude_categories=["Cs"], exclude_characters="\0\n\\\"'")


def _escaped_bytes(character: str) -> str:
    return "".join(f"\\x{byte:02x}" if byte % 2 else f"\\{byte:03o}" for byte in character.encode())


_PIECES = st.one_of(
    _CHARACTERS,
    st.sampled_from(
        ("\\a", "\\b", "\\f", "\\n", "\\r", "\\t", "\\v", "\\\\", "\\'", '\\"', "\\0", "\\7", "\\x9")
    ),
    _CHARACTERS.map(_escaped_bytes),
    st.integers(0, 0xD7FF).map(lambda code: f"\\u{code:04x}"),
    st.integers(0xE000, 0x10FFFF).map(lambda code: f"\\U{code:08X}"),
    st.just("# no comment { [ <"),
)


@st.composite
def _integers(draw: Draw, smallest: int, largest: int) -> str:
    value = draw(st.one_of(st.integers(smallest, largest), st.sampled_from((0, 1, smallest, largest))))
    sign = "-" if value < 0 else draw(st.sampled_from(("", "", "+")))
    form = draw(st.sampled_from(("{}", "{}", "0x{:x}", "0X{:X}", "0{:o}")))
    text = form.format(abs(value))
    return str(text) if sign == "+" and text.startswith("0") else f"{sign}{text}"


@st.composite
def _strings(draw: Draw, is_bytes: bool) -> str:
    literals = []
    for _ in range(draw(st.integers(1, 3)) if draw(st.booleans()) else 1):
        quote = draw(st.sampled_from("\"'"))
        pieces = draw(st.lists(_PIECES, max_size=5))
        if is_bytes:
            pieces += draw(st.lists(st.sampled_from(("\\xff", "\\200", "\\377")), max_size=2))
        if draw(st.booleans()):
            pieces.append("'" if quote == '"' else '"')
        literals.append(f"{quote}{''.join(pieces)}{quote}")
    return str(draw(_OPTIONAL_GAPS)).join(literals)


def _scalar(draw: Draw, field: Any) -> str:
    kind = field.cpp_type
    if kind == _D.CPPTYPE_STRING:
        return str(draw(_strings(field.type == _D.TYPE_BYTES)))
    if kind == _D.CPPTYPE_BOOL:
        return str(draw(st.sampled_from(("true", "false", "t", "f", "True", "False", "1", "0"))))
    if kind == _D.CPPTYPE_ENUM:
        value = draw(st.sampled_from(list(field.enum_type.values)))
        return str(draw(st.sampled_from((value.name, str(value.number), hex(value.number)))))
    if kind in _LIMITS:
        return str(draw(_integers(*_LIMITS[kind])))
    return str(draw(_FLOATS))


def _block(draw: Draw, field: Any, depth: int) -> str:
    inner = field.message_type
    opening, closing = draw(st.sampled_from(("{}", "{}", "<>")))
    if inner.full_name == "google.protobuf.Any":
        gap = draw(_OPTIONAL_GAPS)
        colon = draw(st.sampled_from(("", ":")))
        sample = sample_class().DESCRIPTOR
        body = f"[{gap}{URL}{gap}]{colon} {{{_fields(draw, sample, depth + 1)}}}"
    else:
        body = _fields(draw, inner, depth + 1)
    return f"{opening}{draw(_OPTIONAL_GAPS)}{body}{draw(_OPTIONAL_GAPS)}{closing}"


def _value(draw: Draw, field: Any, depth: int) -> str:
    return _scalar(draw, field) if field.message_type is None else _block(draw, field, depth)


def _field(draw: Draw, field: Any, depth: int) -> str:
    is_block = field.message_type is not None
    colon = draw(st.sampled_from(("", ":", " :"))) if is_block else ":"
    gap = draw(_OPTIONAL_GAPS)
    as_list = is_repeated(field) and draw(st.booleans())
    if as_list:
        items = [_value(draw, field, depth) for _ in range(draw(st.integers(0, 3)))]
        comma = f"{draw(_OPTIONAL_GAPS)},{draw(_OPTIONAL_GAPS)}"
        value = f"[{draw(_OPTIONAL_GAPS)}{comma.join(items)}{draw(_OPTIONAL_GAPS)}]"
    else:
        value = _value(draw, field, depth)
    separator = draw(st.sampled_from(("", "", ",", ";", " ;")))
    return f"{field.name}{colon}{gap}{value}{separator}{draw(GAPS)}"


def _fields(draw: Draw, descriptor: Any, depth: int) -> str:
    usable = [
        field
        for field in descriptor.fields
        if field.full_name != "joshua.Config.include" and (depth < _DEEPEST or field.message_type is None)
    ]
    chosen = draw(st.lists(st.sampled_from(usable), max_size=_MOST_FIELDS)) if usable else []
    written: set[str] = set()
    texts = []
    for field in chosen:
        oneof = field.containing_oneof
        key = oneof.full_name if oneof is not None else field.full_name
        if key in written and not is_repeated(field):
            continue
        written.add(key)
        texts.append(_field(draw, field, depth))
    return "".join(texts)


@st.composite
def config_texts(draw: Draw) -> str:
    """Texts of configurations, nearly all of which are valid."""
    head = draw(st.sampled_from(("", "# A comment.\n", "\n", " ", "# A comment.")))
    if head and not head.endswith(("\n", " ")):
        head += "\n"
    tail = draw(st.sampled_from(("", "\n", "# The end.", "# é\n")))
    return f"{head}{_fields(draw, Config.DESCRIPTOR, 0)}{tail}"


_SNIPPETS = st.sampled_from(
    [*"{}<>[]:,;#\"'\\=.-+ \n\t", "0x", "1e9", '""', "node {", "}\n", "inf", "\\x", "-", "/", "“", "mode: 3"]
)


@st.composite
def damaged_texts(draw: Draw) -> str:
    """Texts of configurations with a few random cuts, insertions and repetitions."""
    text = str(draw(config_texts()))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        change = draw(st.sampled_from(("cut", "insert", "repeat", "swap")))
        if change == "cut":
            text = text[:start] + text[end:]
        elif change == "insert":
            text = text[:start] + draw(st.one_of(_SNIPPETS, st.text(max_size=3))) + text[start:]
        elif change == "repeat":
            text = text[:end] + text[start:]
        else:
            text = text[:start] + text[start:end][::-1] + text[end:]
    return text.replace("\0", "")
