"""The registry: finds the installed implementation for an enum value and configuration block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TypeGuard, TypeVar

from joshua.plan import installing
from joshua.plugins import hints
from joshua.plugins.discovery import CORE_DISTRIBUTION, PluginRow, PluginStatus, normalise
from joshua.plugins.specs import (
    Environment,
    EnvironmentSpec,
    ExtensionSpec,
    ModelSpec,
    ModeOffer,
    PluginSpec,
    SimulatorSpec,
    TransportSpec,
)
from joshua.plugins.targets import TargetError, load_target

SpecT = TypeVar("SpecT", bound=PluginSpec)


def _overlap(first: PluginSpec, second: PluginSpec) -> tuple[str, ...] | None:
    """Enum values that both support; ``()`` if one supports all; None if they do not overlap."""
    if (first.kind, first.block) != (second.kind, second.block):
        return None
    named = isinstance(first, (ExtensionSpec, ModeOffer, TransportSpec))
    if named and getattr(first, "name", "") != getattr(second, "name", ""):
        return None
    mine, others = first.enum_values, second.enum_values
    if isinstance(first, EnvironmentSpec) and isinstance(second, EnvironmentSpec):
        # several may offer some, if all differ
        mine, others = (tuple(offer.id for offer in spec.environments) for spec in (first, second))
    elif not mine or not others:
        return ()
    return tuple(value for value in mine if value in others) or None


def _subject(block: str, *values: str) -> str:
    return " with ".join(part for part in (", ".join(values), block) if part)


def _answers(spec: PluginSpec, kind: type[SpecT], enum_value: str) -> TypeGuard[SpecT]:
    """Whether a spec has a kind and supports an enum value; "" for any."""
    fits = not enum_value or not spec.enum_values or enum_value in spec.enum_values
    return isinstance(spec, kind) and fits


class Registry:
    """The specs of the installed plugins.

    Two plugins that provide the same thing conflict, and neither is used for it. Installing a package
    therefore never changes silently which driver runs. Only specs of the core stay in use.
    """

    def __init__(self, rows: tuple[PluginRow, ...]) -> None:
        self._rows, self._usable, self._withdrawn = _settle_conflicts(rows)

    def rows(self) -> tuple[PluginRow, ...]:
        """All plugins in the order of discovery, including broken and blocked ones."""
        return self._rows

    def find(self, kind: type[SpecT], block: str, enum_value: str = "") -> SpecT | None:
        """Find the only implementation for a block and an enum value; None if none or several match.

        Args:
            block: member of a oneof such as ``lidar_config``, or for an ``Any`` block the full name of its
                message (``acme.GripperConfig``); "" for any.
            enum_value: name such as ``PERCEPTION_LIDAR``; "" for any.
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
        """Whether a name is that of an installed plugin, as for ``--block-plugin``."""
        wanted = normalise(name)
        return any(wanted in (row.distribution, normalise(row.name)) for row in self._rows)

    def owner(self, spec: PluginSpec) -> PluginRow:
        """The plugin of a spec. Raises KeyError for a spec of another registry."""
        for mine, row in self._usable:
            if mine is spec:
                return row
        raise KeyError(f"{spec.implementation} is not of this registry")

    def is_packaged(self, name: str) -> bool | None:
        """Whether a file of this name ships with a plugin, such as the model ``so_arm100/scene.xml``.

        Returns:
            None if no installed plugin provides files, so that it is unknown.
        """
        found = list(self._packaged(SimulatorSpec, name))
        return any(path is not None for path in found) if found else None

    def packaged_weights(self, name: str) -> Path | None:
        """Weights of this name that ship with the plugin of a model; None if there are none.

        Args:
            name: such as ``joshua/so_arm100/reach``, as a file writes it.
        """
        return next((path for path in self._packaged(ModelSpec, name) if path is not None), None)

    def _packaged(self, kind: type[ModelSpec | SimulatorSpec], name: str) -> Iterator[Path | None]:
        """What each plugin of a kind that ships files answers to a name."""
        for spec, _ in self._usable:
            if isinstance(spec, kind) and spec.packaged_files:
                try:
                    yield load_target(spec.packaged_files)(name)
                except TargetError:
                    continue  # `joshua plugins --check` reports the reason

    def environments(self, backend: str = "") -> tuple[tuple[Environment, EnvironmentSpec], ...]:
        """The environments for trainers, each with its spec.

        Args:
            backend: name of a ``SimulatorBackend``; "" for any.
        """
        fitting = [offer for offer, _ in self._usable if _answers(offer, EnvironmentSpec, backend)]
        return tuple((environment, offer) for offer in fitting for environment in offer.environments)

    def modes(self) -> dict[str, ModeOffer]:
        """The modes of plugins, by their name or enum value."""
        offers = (spec for spec, _ in self._usable if isinstance(spec, ModeOffer))
        return {offer.name or offer.enum_values[0]: offer for offer in offers}

    def transports(self) -> dict[str, TransportSpec]:
        """The transports by name, such as ``zenoh``, including those of third parties."""
        offers = (spec for spec, _ in self._usable if isinstance(spec, TransportSpec))
        return {offer.name or TransportSpec.short(offer.enum_values[0]): offer for offer in offers}

    def extensions(self) -> tuple[str, ...]:
        """Import strings of the extensions for every node."""
        return tuple(spec.implementation for spec, _ in self._usable if isinstance(spec, ExtensionSpec))

    def message_modules(self) -> tuple[str, ...]:
        """Import strings of the ``_pb2`` modules that register third-party blocks. All are imported."""
        modules = (p.message_module for row in self._rows for p in row.specs if p.message_module)
        return tuple(dict.fromkeys(modules))

    def message_types(self) -> tuple[str, ...]:
        """Full names of the messages allowed in an ``Any`` block."""
        names = (p.block for row in self._rows for p in row.specs if p.message_module)
        return tuple(dict.fromkeys(names))

    def missing(self, node_name: str, kind: type[PluginSpec], block: str, enum_value: str = "") -> str:
        """Why ``find`` returned nothing, and what to do, in one sentence.

        Such as ``lidar_front: PERCEPTION_LIDAR requires the plugin joshua-lidar, which is not installed: …``.
        """
        return f"{node_name}: {self._reason(kind, block, enum_value)}"

    def _reason(self, kind: type[PluginSpec], block: str, enum_value: str) -> str:
        distribution = hints.distribution_for(block, enum_value)
        by_value = enum_value and distribution and distribution == hints.stated().enum_values.get(enum_value)
        what = enum_value if by_value else _subject(block, *filter(None, (enum_value,)))
        for spec, reason in self._withdrawn:
            if _answers(spec, kind, enum_value) and spec.block in (block, ""):
                return f"two plugins provide {what}: {reason}"
        for spec, row in self._usable:
            if block and isinstance(spec, kind) and spec.block == block:
                allowed = ", ".join(spec.enum_values)
                return f"{row.distribution} provides {block} for {allowed}, not for {enum_value}"
        if not distribution:
            return f"{what} requires a plugin that provides it, and {self._none_in_use()}"
        rows = [row for row in self._rows if row.distribution == distribution]
        if not rows:
            return f"{what} {installing.requires(distribution)}"
        needs, row = f"{what} requires the plugin {distribution}, ", rows[0]
        if row.status is PluginStatus.BLOCKED:
            return f"{needs}which is blocked: leave out --block-plugin {row.name}"
        if row.status is PluginStatus.BROKEN:
            reasons = "; ".join(row.reasons)
            return f"{needs}which is broken ({reasons}): {installing.reinstall(distribution)}"
        return f"{needs}and {row.version} does not provide it: {installing.upgrade(distribution)}"

    def remedy(self, kind: type[PluginSpec], block: str, enum_value: str = "") -> str:
        """What to do if ``find`` returned nothing."""
        if block and any(isinstance(offer, kind) and offer.block == block for offer, _ in self._usable):
            return "use one of these types, or another block"
        distribution = hints.distribution_for(block, enum_value)
        rows = [row for row in self._rows if row.distribution == distribution or not distribution]
        if any(row.status is PluginStatus.BLOCKED for row in rows):
            return "leave --block-plugin out, or use a device that needs no blocked plugin"
        if any(row.distribution == distribution for row in rows):
            return "run `joshua plugins` to see why it is not used"
        return "install the plugin, then run `joshua plugins` to check it"

    def _none_in_use(self) -> str:
        """Why no plugin provides a third party's block, and what to do. Its plugin may be out of use."""
        status = (PluginStatus.BLOCKED, PluginStatus.BROKEN)
        unused = [f"{row.distribution} is {row.status.value}" for row in self._rows if row.status in status]
        if unused:
            return f"no plugin in use does ({', '.join(unused)}): see joshua plugins"
        return "none is installed: install the vendor's package, then run joshua plugins"


_Settled = tuple[
    tuple[PluginRow, ...], tuple[tuple[PluginSpec, PluginRow], ...], tuple[tuple[PluginSpec, str], ...]
]


def _settle_conflicts(rows: tuple[PluginRow, ...]) -> _Settled:
    """Find plugins that provide the same thing: rows, usable specs, and unusable ones with the reason."""
    reasons: dict[int, list[str]] = {}
    withdrawn: list[tuple[PluginSpec, str]] = []
    offers = [(index, spec) for index, row in enumerate(rows) for spec in row.specs]
    for (index, spec), (other_index, other) in combinations(offers, 2):
        if index == other_index or (common := _overlap(spec, other)) is None:
            continue
        first, second = _label(rows, index), _label(rows, other_index)
        what = _subject(spec.block, *common)
        losers = [(index, spec), (other_index, other)]
        if rows[index].distribution == CORE_DISTRIBUTION:
            reason = f"{second} and {first} both provide {what}; {first} is used"
            losers = losers[1:]
        else:
            reason = (
                f"{first} and {second} both provide {what}; neither is used for it: "
                f"choose with --block-plugin {first} or --block-plugin {second}"
            )
        for at, offer in losers:
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
    """The argument of --block-plugin: the distribution, or the entry point if it has several."""
    row = rows[index]
    alone = sum(other.distribution == row.distribution for other in rows) == 1
    return row.distribution if alone else row.name
