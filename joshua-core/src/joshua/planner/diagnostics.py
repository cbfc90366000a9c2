"""The findings of planning: missing plugins, refused settings, hosts without a share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from joshua.plan import Diagnostic, Position, Related, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence
from joshua.plugins.hints import not_yet
from joshua.textproto.nearest import nearest_first

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.planner.devices import Wanted
    from joshua.plugins import PluginSpec, Registry


class Diagnostics:
    """Collects what planning finds, with positions."""

    def __init__(self, loaded: LoadedConfig, *, launch: bool) -> None:
        self.positions = loaded.positions
        self.launch = launch
        self.items: list[Diagnostic] = []

    def add(
        self,
        code: str,
        severity: Severity,
        message: str,
        path: str = "",
        *,
        remedy: str = "",
        found: str = "",
        allowed: tuple[str, ...] = (),
        related: tuple[Related, ...] = (),
    ) -> None:
        """Adds one finding at a field path; the position is that of the value, else of its name."""
        self.items.append(
            Diagnostic(
                code,
                severity,
                as_sentence(message),
                self._position(path),
                path,
                found,
                allowed,
                as_instruction(remedy),
                related,
            )
        )

    def _position(self, path: str) -> Position | None:
        return (self.positions.name(path) or self.positions.value(path)) if path else None

    def plugin_missing(self, wants: Sequence[Wanted], registry: Registry) -> None:
        """Devices or models of one kind and block whose plugin is not installed.

        One finding for all of them: an error at launch, else a note.
        """
        first = wants[0]
        names = ", ".join(want.entry.node.node_name or want.entry.owner_path for want in wants)
        # Several nodes with one block may have different roles, none of which matters here.
        same_role = len({want.enum_value for want in wants}) == 1
        enum_value = first.enum_value if same_role or not first.block_name else ""
        self.add(
            "plugin-missing",
            Severity.ERROR if self.launch else Severity.NOTE,
            registry.missing(names, first.kind, first.block_name, enum_value),
            first.block_path,
            remedy=registry.remedy(first.kind, first.block_name, enum_value),
            related=tuple(
                Related(position=place, label=f"{want.entry.node.node_name} needs it too")
                for want in wants[1:]
                if (place := self._position(want.block_path)) is not None
            ),
        )

    def service_missing(
        self, path: str, kind: type[PluginSpec], value: str, registry: Registry, *, required: bool
    ) -> None:
        """A service block whose plugin is not installed: the mode needs it, or it can do without."""
        block = path.rpartition(".")[2]
        sentence = registry.missing(block, kind, block, value)
        _, instead = not_yet(kind, block)
        if not required:
            sentence += "; the run goes on without it"
        if not self.launch:
            severity, remedy = Severity.NOTE, "install it before the launch"
        elif required:
            severity, remedy = Severity.ERROR, "install the plugin"
        else:
            severity, remedy = Severity.WARNING, f"install the plugin, or remove the {block} block"
        self.add("plugin-missing", severity, sentence, path, remedy=instead or remedy)

    def nothing_to_block(self, name: str, registry: Registry) -> None:
        """A name of ``--block-plugin`` that no plugin has: what it was meant for is loaded."""
        known = [row.distribution for row in registry.rows()]
        self.add(
            "block-unknown",
            Severity.WARNING,
            f"--block-plugin names {name!r}, and no plugin of that name is installed",
            found=name,
            allowed=tuple(dict.fromkeys(nearest_first(name, known))),
            remedy="correct the name, or leave the option out",
        )

    def native_missing(self, wants: Sequence[Wanted], distribution: str) -> None:
        """Nodes whose plugin lacks the native implementation that they ask for: said once, at launch."""
        if self.launch:
            names = ", ".join(want.entry.node.node_name for want in wants)
            self.add(
                "native-missing",
                Severity.NOTE,
                f"{distribution} has no native implementation for {names}: the Python implementation runs",
                f"{wants[0].entry.path}.node_type",
            )

    def no_share(self, host: str, hosts: list[str]) -> None:
        """No node of the file runs on this machine."""
        if host:
            self.add(
                "unknown-host",
                Severity.ERROR,
                f"No node of the file runs on the host {host!r}",
                found=host,
                allowed=tuple(nearest_first(host, hosts)),
                remedy="name a host of the file with --host, or set `host` in its nodes",
            )
            return
        self.add(
            "host-needed",
            Severity.ERROR,
            "Every node of the file names a host, so this machine's share is not known",
            allowed=tuple(hosts),
            remedy=f"add --host {hosts[0]}",
        )
