"""Settings of drivers: made from their configuration blocks, in SI units, checked by pydantic."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from typing_extensions import Self

from joshua.plan import Diagnostic, Position, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence, masked
from joshua.plan.joints import JointRange
from joshua.plugins.block_context import BlockContext
from joshua.plugins.targets import TargetError, load_target

if TYPE_CHECKING:
    from google.protobuf.message import Message

    from joshua.plugins.specs import PluginSpec


def _unchanged(value: Any) -> Any:
    return value


@dataclass(frozen=True)
class FromField:
    """Names the block field of a setting, as metadata of ``typing.Annotated``.

    Attributes:
        path: field of the block, with dots into inner messages, such as ``comm.serial.port``.
        convert: converts the block's unit to the setting's, such as ticks to radians.
    """

    path: str
    convert: Callable[[Any], Any] = _unchanged


class FieldError(ValueError):
    """A rule across fields is broken. Raised by a validator of a settings model.

    Args:
        field: field of the block for the finding, such as ``position_max``.
        message: what is wrong and why, one sentence.
        allowed: allowed values, the nearest first.
        remedy: what to do next, one imperative sentence.
        code: of the finding; ``extra-missing`` or ``machine-unfit`` if the fault is this machine's.
    """

    def __init__(
        self,
        field: str,
        message: str,
        *,
        allowed: Sequence[str] = (),
        remedy: str = "",
        code: str = "invalid-setting",
    ) -> None:
        super().__init__(message)
        self.field = field
        self.allowed = tuple(allowed)
        self.remedy = remedy
        self.code = code


class FieldErrors(ValueError):
    """One or more rules are broken. Raised by a validator after all checks."""

    def __init__(self, errors: Sequence[FieldError]) -> None:
        super().__init__("; ".join(str(error) for error in errors))
        self.errors = tuple(errors)


class BlockSettings(BaseModel):
    """Base class of settings: frozen, JSON-able, SI units.

    Each setting is the block's field of the same name, or the converted one that ``FromField`` names. Do not
    repeat defaults and ranges: an omitted field has the default of its ``FieldRule``, and ranges are checked
    before a settings model is made. Validators add rules across fields and raise ``FieldError``, or
    ``FieldErrors`` for several. Override ``si_values`` for values that depend on several fields, the node or
    the rest of the file.

    A settings module is imported during validation, and by the process that nodes are forked from, so it must
    not import drivers or anything heavy, nor start a thread.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        defer_build=True,  # a process needs only those of its own devices
    )

    @classmethod
    def from_block(
        cls, block: Message, node: Message | None = None, context: BlockContext | None = None
    ) -> Self:
        """Make the settings of a block. Arguments as for ``make_settings``.

        Raises:
            pydantic.ValidationError: a value or a rule across fields is broken.
        """
        # Imported here because of protobuf: a child process gets its settings without a block.
        from joshua.plugins.block_values import block_values

        return cls.model_validate(cls.si_values(block_values(block), node, context or BlockContext()))

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Convert the block's values (see ``block_values``) to the values of the settings."""
        del node, context  # for overriding methods
        result: dict[str, Any] = {}
        for name, field in cls.model_fields.items():
            source = source_of(name, field)
            value = _look_up(values, source.path)
            if value is not None:
                result[name] = source.convert(value)
        return result

    def warnings(self) -> Sequence[FieldError]:
        """What is valid, but probably does not work as intended. Each becomes a warning at its field."""
        return ()


class ActuatorSettings(BlockSettings):
    """Base class of the settings of actuators, which define the joints."""

    def joints(self) -> tuple[JointRange, ...]:
        """The joints in order, known without a connection or the driver."""
        raise NotImplementedError(f"{type(self).__name__} names no joints: override joints")

    def exclusive(self) -> Mapping[str, str]:
        """Return what no second node may drive, such as simulated joints, by the field that names each."""
        return {}


class Positions(Protocol):
    """Positions of the values of a loaded configuration (``LoadedConfig.positions``)."""

    def nearest(self, field_path: str) -> Position | None:
        """Position of a field's value, else of the innermost enclosing block."""


def make_settings(
    spec: PluginSpec,
    block: Message,
    *,
    node: Message | None = None,
    context: BlockContext | None = None,
    field_path: str = "",
    positions: Positions | None = None,
) -> tuple[BlockSettings | None, list[Diagnostic]]:
    """Make the settings of a spec, with problems as diagnostics.

    Args:
        node: the ``Node`` block beside the block; context: from the rest of the file.
        field_path: of the block, such as ``robot.actions[0].mock_motor_config``.
        positions: of the loaded configuration; None for diagnostics without positions.

    Returns:
        The settings and their warnings; None and the problems; or None and no diagnostic for a spec
        without a settings model.
    """
    from joshua.plugins.block_values import block_values

    if not spec.settings:
        return None, []
    reason = ""
    try:
        settings_type = load_target(spec.settings)
        if isinstance(settings_type, type) and issubclass(settings_type, BlockSettings):
            settings = settings_type.from_block(block, node, context)
            warned = [
                _diagnostic(problem, Severity.WARNING, block_values(block), field_path, positions)
                for problem in settings.warnings()
            ]
            return settings, warned
        reason = f"{spec.settings} is not derived from joshua.plugins.settings.BlockSettings"
    except TargetError as error:
        reason = str(error)
    except ValidationError as error:
        return None, settings_diagnostics(error, settings_type, block, field_path, positions)
    except Exception as error:  # noqa: BLE001 (a plugin's code: its defect is a finding, not a crash)
        reason = f"{spec.settings} cannot read the block: {type(error).__name__}: {error}"
    broken = Diagnostic(
        code="broken-plugin",
        severity=Severity.ERROR,
        message=as_sentence(f"The plugin that provides {spec.block} is broken: {reason}"),
        position=positions.nearest(field_path) if positions is not None else None,
        field_path=field_path,
        remedy="Reinstall or block the plugin. `joshua plugins --check` lists the reasons.",
    )
    return None, [broken]


def settings_diagnostics(
    error: ValidationError,
    settings_type: type[BlockSettings],
    block: Message,
    field_path: str = "",
    positions: Positions | None = None,
) -> list[Diagnostic]:
    """Convert each pydantic error of a settings model to a diagnostic on the block's field."""
    from joshua.plugins.block_values import block_values

    values = block_values(block)
    return [
        _diagnostic(problem, Severity.ERROR, values, field_path, positions)
        for problem in _problems(error, settings_type, block)
    ]


def _diagnostic(
    problem: FieldError,
    severity: Severity,
    values: Mapping[str, Any],
    field_path: str,
    positions: Positions | None,
) -> Diagnostic:
    """Return the finding about a field of a block with these values."""
    path = ".".join(part for part in (field_path, problem.field) if part)
    found = _look_up(values, problem.field) if problem.field else None
    remedy = problem.remedy or "Change the value. `joshua explain` describes the field"
    return Diagnostic(
        code=problem.code,
        severity=severity,
        message=as_sentence(_begun(str(problem))),
        position=positions.nearest(path) if positions is not None else None,
        field_path=path,
        found="" if found is None else masked(_as_text(found)),
        allowed=problem.allowed,
        remedy=as_instruction(remedy),
    )


def _problems(
    error: ValidationError, settings_type: type[BlockSettings], block: Message
) -> Iterator[FieldError]:
    for detail in error.errors(include_url=False):
        problem = detail.get("ctx", {}).get("error")
        if isinstance(problem, FieldErrors):
            yield from problem.errors
        elif isinstance(problem, FieldError):
            yield problem
        else:
            yield _field_error(detail, settings_type, block)


# Words at the start of a message that are not the name of a field or joint.
_PLAIN_WORDS = frozenset(("a", "an", "the", "one", "two", "no", "each", "every", "nobody"))


def _begun(message: str) -> str:
    """Capitalise a message, unless it may begin with a name."""
    is_word = message.partition(" ")[0] in _PLAIN_WORDS
    return message[0].upper() + message[1:] if is_word else message


_BOUNDS = {
    "ge": "at least",
    "gt": "more than",
    "le": "at most",
    "lt": "less than",
    "min_length": "a length of at least",
    "max_length": "a length of at most",
    "expected": "one of",
}


def _field_error(detail: Any, settings_type: type[BlockSettings], block: Message) -> FieldError:
    """Convert an error of pydantic itself to a broken rule."""
    inner = _block_path(detail["loc"], settings_type)
    if detail["type"] == "missing":
        return FieldError(inner, f"{inner} is missing")
    message = f"{inner or block.DESCRIPTOR.name}: {detail['msg'].removeprefix('Value error, ')}"
    bounds = detail.get("ctx", {}).items()
    return FieldError(
        inner, message, allowed=[f"{_BOUNDS[key]} {value}" for key, value in bounds if key in _BOUNDS]
    )


def source_of(name: str, field: FieldInfo) -> FromField:
    """Source of a setting: from its metadata, else the field of the same name."""
    return next((entry for entry in field.metadata if isinstance(entry, FromField)), FromField(name))


def _look_up(values: Mapping[str, Any], path: str) -> Any:
    """Value at a dotted path with optional indices; None if a part is missing."""
    current: Any = values
    for part in path.replace("[", ".").replace("]", "").split("."):
        if isinstance(current, Mapping):
            current = current.get(part)
        elif isinstance(current, Sequence) and part.isdigit() and int(part) < len(current):
            current = current[int(part)]
        else:
            return None
    return current


def _block_path(location: tuple[int | str, ...], settings_type: type[BlockSettings]) -> str:
    if not location:
        return ""
    name = str(location[0])
    field = settings_type.model_fields.get(name)
    path = source_of(name, field).path if field else name
    return path + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location[1:])


def _as_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) and not value.isupper() else str(value)
