"""What a file says of Weights & Biases and MLflow, and whether this machine can use them."""

from __future__ import annotations

import importlib.util
import netrc
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from joshua.api import FieldError, FieldErrors
from joshua.tools import install
from pydantic import BaseModel, ConfigDict

#: Public server of Weights & Biases.
WANDB = "https://api.wandb.ai"


class WandbSettings(BaseModel):
    """Settings of Weights & Biases: the block ``wandb``."""

    model_config = ConfigDict(frozen=True)

    project: str = "joshua"
    entity: str = ""
    server: str = ""
    offline: bool = False

    @property
    def is_offline(self) -> bool:
        """Whether the run is only written into its folder."""
        return self.offline or os.environ.get("WANDB_MODE", "") in ("offline", "dryrun")

    @property
    def address(self) -> str:
        """Address of the server."""
        return self.server or os.environ.get("WANDB_BASE_URL", "") or WANDB

    @property
    def host(self) -> str:
        """Host of the server."""
        return urlsplit(self.address).hostname or self.address

    def has_login(self) -> bool:
        """Whether the environment or ``wandb login`` gives a key, or none is needed."""
        if self.is_offline or os.environ.get("WANDB_API_KEY"):
            return True
        try:
            return netrc.netrc(os.environ.get("NETRC")).authenticators(self.host) is not None
        except (OSError, netrc.NetrcParseError):
            return False


class MlflowSettings(BaseModel):
    """Settings of MLflow: the block ``mlflow``; ``server`` is an address or an absolute folder, or ""."""

    model_config = ConfigDict(frozen=True)

    experiment: str = "joshua"
    server: str = ""


class TrackingSettings(BaseModel):
    """The services that the file chooses, each by its block."""

    model_config = ConfigDict(frozen=True)

    wandb: WandbSettings | None = None
    mlflow: MlflowSettings | None = None

    @classmethod
    def of(cls, training: Mapping[str, Any], folder: Path) -> TrackingSettings:
        """Return the settings of a block ``training``.

        Args:
            training: fields by name; folder: that of the file, to which folders are relative.
        """
        given = {
            name: {key: value for key, value in (training.get(name) or {}).items() if value}
            for name in cls.model_fields
            if training.get(name) is not None
        }
        server = given.get("mlflow", {}).get("server", "")
        if server and ":" not in server:
            given["mlflow"]["server"] = str(folder / Path(server).expanduser())
        return cls.model_validate(given)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the blocks of the services."""
        return tuple(name for name in type(self).model_fields if getattr(self, name) is not None)

    def require(self) -> None:
        """Refuse services that cannot work: no package, no login. Raises FieldErrors."""
        found = [*self._lacks()]
        if found:
            raise FieldErrors(found)

    def _lacks(self) -> Iterator[FieldError]:
        for name in self.names:
            if importlib.util.find_spec(name) is None:
                yield FieldError(
                    name,
                    f"{name} requires the package {name}, which {sys.executable} does not have",
                    remedy=f"Install it: {install('joshua-training', name)}",
                    code="extra-missing",
                )
        if self.wandb is not None and not self.wandb.has_login():
            yield FieldError(
                "wandb",
                f"There is no login for {self.wandb.host} in the environment",
                remedy="Set WANDB_API_KEY, or run wandb login, or write offline: true",
            )
