"""The registry: from enum value and configuration block to the implementation that is installed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TypeGuard, TypeVar

from joshua.plan import installing
from joshua.plugins import hints
from joshua.plugins.discovery import CORE_DISTRIBUTION, normalise
from joshua.plugins.specs import (
    Environment,
    EnvironmentSpec,
    ModeOffer,
    PluginSpec,
    SimulatorSpec,
    TransportSpec,
)
from joshua.plugins.targets import TargetError, load_target

SpecT = TypeVar("SpecT", bound=PluginSpec)


class PluginStatus(str, Enum):
    """What became of a plugin when the host looked at it."""

    OK = "ok"
    BROKEN = "broken"
    BLOCKED = "blocked"
    CONFLICT = "conflict"


@dataclass(frozen=True)
class PluginRow:
    """One plugin of the host: a row of ``joshua plugins``.

    Attributes:
        name: name of the entry point; distribution, version: of the package that declares it.
        status: what became of it; reasons: one sentence each, empty where all is well.
        specs: what it provides; empty for a broken or blocked plugin.
        module: where the entry point leads, such as ``joshua_lidar.plugin``.
    """

    name: str
    distribution: str
    version: str
    status: PluginStatus
    reasons: tuple[str, ...] = ()
    specs: tuple[PluginSpec, ...] = ()
    module: str = ""


def _overlap(first: PluginSpec, second: PluginSpec) -> tuple[str, ...] | None:
    """Enum values that both answer for; ``()`` where one answers for all; None where they do not meet."""
    if (first.kind, first.block) != (second.kind, second.block):
        return None
    if isinstance(first, EnvironmentSpec) and isinstance(second, EnvironmentSpec):
        # many may offer some, as long as each is another one
        ids = [offer.id for offer in second.environments]
        return tuple(offer.id for offer in first.environments if offer.id in ids) or None
    if isinstance(first, (ModeOffer, TransportSpec)) and first.name != getattr(second, "name", ""):
        return None
    if not first.enum_values or not second.enum_values:
        return ()
    common = tuple(value for value in first.enum_values if value in second.enum_values)
    return common or None


def _subject(spec: PluginSpec, values: tuple[str, ...]) -> str:
    return " with ".join(part for part in (", ".join(values), spec.block) if part)


def _answers(spec: PluginSpec, kind: type[SpecT], enum_value: str) -> TypeGuard[SpecT]:
    """Whether something is of a kind and fits an enum value; "" asks for none in particular."""
    fits = not enum_value or not spec.enum_values or enum_value in spec.enum_values
    return isinstance(spec, kind) and fits


class Registry:
    """What the installed plugins provide.

    Two plugins that provide the same thing are a conflict: neither is used for it, so that installing a
    package never changes silently which driver runs; only what the core provides stays in force.
    """

    def __init__(self, rows: tuple[PluginRow, ...]) -> None:
        self._rows, self._usable, self._withdrawn = _settle_conflicts(rows)

    def rows(self) -> tuple[PluginRow, ...]:
        """All plugins in the order of discovery, the broken and the blocked included."""
        return self._rows

    def find(self, kind: type[SpecT], block: str, enum_value: str = "") -> SpecT | None:
        """Finds the implementation for a configuration block and an enum value.

        Args:
            kind: what is asked for.
            block: member of a oneof such as ``lidar_config``, or for an ``Any`` block the full name of
                its message (``acme.GripperConfig``); "" asks by enum value alone.
            enum_value: name such as ``PERCEPTION_LIDAR``; "" accepts every one.

        Returns:
            The one spec that fits, or None where there is none or more than one
            (``missing`` says why).
        """
        fitting = [offer for offer, _ in self._usable if _answers(offer, kind, enum_value)]
        for wanted in dict.fromkeys((block, "")):
            matches = [spec for spec in fitting if spec.block == wanted]
            if len(matches) == 1:
                return matches[0]
        if not block and enum_value and len(fitting) == 1:
            return fitting[0]
        return None

    def knows(self, name: str) -> bool:
        """Whether a name is that of an installed plugin, as ``--block-plugin`` takes it."""
        wanted = normalise(name)
        return any(wanted in (row.distribution, normalise(row.name)) for row in self._rows)

    def owner(self, spec: PluginSpec) -> PluginRow:
        """The plugin that provides something. Raises KeyError for what another registry has."""
        for mine, row in self._usable:
            if mine is spec:
                return row
        raise KeyError(f"{spec.implementation} is not of this registry")

    def is_packaged(self, name: str) -> bool | None:
        """Whether a file of this name ships with a plugin, such as the model ``so_arm100/scene.xml``.

        Returns:
            None where no installed plugin brings any files, so that nobody can tell.
        """
        answer = None
        for spec, _ in self._usable:
            if isinstance(spec, SimulatorSpec) and spec.packaged_files:
                try:
                    found = load_target(spec.packaged_files)(name)
                except TargetError:
                    continue  # `joshua plugins --check` says what is wrong with it
                if found is not None:
                    return True
                answer = False
        return answer

    def environments(self, backend: str = "") -> tuple[tuple[Environment, EnvironmentSpec], ...]:
        """The environments that trainers can be given, each with the spec that makes it.

        Args:
            backend: name of a ``SimulatorBackend``; "" asks for none in particular.
        """
        fitting = [offer for offer, _ in self._usable if _answers(offer, EnvironmentSpec, backend)]
        return tuple((environment, offer) for offer in fitting for environment in offer.environments)

    def modes(self) -> dict[str, ModeOffer]:
        """The modes that plugins bring, by their own name or by the enum value that they answer for."""
        offers = (spec for spec, _ in self._usable if isinstance(spec, ModeOffer))
        return {offer.name or offer.enum_values[0]: offer for offer in offers}

    def transports(self) -> dict[str, TransportSpec]:
        """The transports by name, such as ``zenoh``; those of third parties by their own."""
        offers = (spec for spec, _ in self._usable if isinstance(spec, TransportSpec))
        return {offer.name or TransportSpec.short(offer.enum_values[0]): offer for offer in offers}

    def message_modules(self) -> tuple[str, ...]:
        """Import strings of the ``_pb2`` modules that register third-party blocks; all are imported."""
        modules = (p.message_module for row in self._rows for p in row.specs if p.message_module)
        return tuple(dict.fromkeys(modules))

    def message_types(self) -> tuple[str, ...]:
        """Full names of the messages that may stand in an ``Any`` block."""
        names = (p.block for row in self._rows for p in row.specs if p.message_module)
        return tuple(dict.fromkeys(names))

    def missing(self, node_name: str, kind: type[PluginSpec], block: str, enum_value: str = "") -> str:
        """Says why ``find`` has nothing, and what to do.

        Returns:
            One sentence such as
            ``lidar_front: PERCEPTION_LIDAR needs the plugin joshua-lidar: pip install joshua-lidar``.
        """
        what = hints.subject(block, enum_value)
        for spec, reason in self._withdrawn:
            if _answers(spec, kind, enum_value) and spec.block in (block, ""):
                return f"{node_name}: {what} is provided twice: {reason}"
        for spec, row in self._usable:
            if block and isinstance(spec, kind) and spec.block == block:
                allowed = ", ".join(spec.enum_values)
                return f"{node_name}: {row.distribution} provides {block} for {allowed}, not for {enum_value}"
        sentence, _ = hints.not_yet(kind, block)
        if sentence:
            return f"{node_name}: {sentence}"
        distribution = hints.distribution_for(block, enum_value)
        if not distribution:
            return f"{node_name}: {what} needs a plugin that provides it, and {self._nobody()}"
        for row in self._rows:
            if row.distribution == distribution and row.status is PluginStatus.BLOCKED:
                return (
                    f"{node_name}: {what} needs the plugin {distribution}, which is blocked: "
                    f"leave out --block-plugin {row.name}"
                )
            if row.distribution == distribution and row.status is PluginStatus.BROKEN:
                return (
                    f"{node_name}: {what} needs the plugin {distribution}, which is broken "
                    f"({'; '.join(row.reasons)}): {installing.reinstall(distribution)}"
                )
            if row.distribution == distribution and row.status is PluginStatus.OK:
                return (
                    f"{node_name}: {what} needs the plugin {distribution}, and {row.version} does not "
                    f"provide it: {installing.upgrade(distribution)}"
                )
        return f"{node_name}: {what} needs the plugin {distribution}: {installing.install(distribution)}"

    def remedy(self, kind: type[PluginSpec], block: str, enum_value: str = "") -> str:
        """What to do where ``find`` has nothing."""
        if block and any(isinstance(offer, kind) and offer.block == block for offer, _ in self._usable):
            return "write one of the types that it takes, or another block"
        _, instruction = hints.not_yet(kind, block)
        if instruction:
            return instruction
        distribution = hints.distribution_for(block, enum_value)
        rows = [row for row in self._rows if row.distribution == distribution or not distribution]
        if any(row.status is PluginStatus.BLOCKED for row in rows):
            return "leave --block-plugin out, or take a device that needs no blocked plugin"
        if any(row.distribution == distribution for row in rows):
            return "see what `joshua plugins` lists, and why something is not used"
        return "install the plugin, then see what `joshua plugins` lists"

    def _nobody(self) -> str:
        """Why no plugin provides a third party's block, and what to do; it may be one that is not in use."""
        unused = [
            f"{row.distribution} is {row.status.value}"
            for row in self._rows
            if row.status in (PluginStatus.BLOCKED, PluginStatus.BROKEN)
        ]
        if unused:
            return f"no plugin in use does ({', '.join(unused)}): see joshua plugins"
        return "none is installed: pip install the vendor's package, then see joshua plugins"


def _settle_conflicts(
    rows: tuple[PluginRow, ...],
) -> tuple[
    tuple[PluginRow, ...], tuple[tuple[PluginSpec, PluginRow], ...], tuple[tuple[PluginSpec, str], ...]
]:
    """Marks plugins that provide the same thing.

    Returns:
        The rows; what may be used, with its row; what may not, with the reason.
    """
    reasons: dict[int, list[str]] = {}
    withdrawn: list[tuple[PluginSpec, str]] = []
    offers = [(index, spec) for index, row in enumerate(rows) for spec in row.specs]
    for position, (index, spec) in enumerate(offers):
        for other_index, other in offers[position + 1 :]:
            if index == other_index or (common := _overlap(spec, other)) is None:
                continue
            first, second = _label(rows, index), _label(rows, other_index)
            what = _subject(spec, common)
            if rows[index].distribution == CORE_DISTRIBUTION:
                reason = f"{second} and {first} both provide {what}; {first} stays in force"
                reasons.setdefault(other_index, []).append(reason)
                withdrawn.append((other, reason))
                continue
            reason = (
                f"{first} and {second} both provide {what}; neither is used for it: "
                f"choose with --block-plugin {first} or --block-plugin {second}"
            )
            for at, offer in ((index, spec), (other_index, other)):
                reasons.setdefault(at, []).append(reason)
                withdrawn.append((offer, reason))
    settled = tuple(
        replace(row, status=PluginStatus.CONFLICT, reasons=row.reasons + tuple(reasons[index]))
        if index in reasons
        else row
        for index, row in enumerate(rows)
    )
    refused = {id(spec) for spec, _ in withdrawn}
    usable = tuple((p, row) for row in settled for p in row.specs if id(p) not in refused)
    return settled, usable, tuple(withdrawn)


def _label(rows: tuple[PluginRow, ...], index: int) -> str:
    """What --block-plugin takes: the distribution, or the entry point where it has several."""
    row = rows[index]
    alone = sum(other.distribution == row.distribution for other in rows) == 1
    return row.distribution if alone else row.name
