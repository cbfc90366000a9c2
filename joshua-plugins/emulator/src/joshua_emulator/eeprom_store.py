"""Storage of EEPROM contents of emulated devices in a file, one per identity."""

from __future__ import annotations

import json
import os
from pathlib import Path

from joshua.api.files import make_private
from joshua.tools import parse_json


class EepromStoreError(Exception):
    """The file is not one that the emulator wrote. The message says what to do."""


class EepromStore:
    """EEPROM images by slot; a path of None stores nothing.

    A slot is the position of the device on its cable, with its kind if several kinds are possible.
    """

    def __init__(self, path: Path | None, identity: str) -> None:
        self._path = path
        self._identity = identity
        self._images: dict[str, str] = {}

    def load(self) -> None:
        """Read the file if it exists. Raises EepromStoreError."""
        if self._path is None or not self._path.exists():
            return
        try:
            content = parse_json(self._path.read_text(encoding="utf-8"))
            images = {str(slot): bytes.fromhex(image).hex() for slot, image in content["slots"].items()}
            identity = content["identity"]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise EepromStoreError(
                f"{self._path}: is not an EEPROM file of the emulator ({type(error).__name__}: {error}); "
                "remove it to start from factory settings"
            ) from error
        if identity != self._identity:
            raise EepromStoreError(
                f"{self._path}: belongs to the device {identity!r}, not to {self._identity!r}; "
                "give each emulated device a file of its own"
            )
        self._images = images

    def image(self, slot: int | str) -> bytes | None:
        """The stored EEPROM of one slot, or None if none is stored."""
        image = self._images.get(str(slot))
        return None if image is None else bytes.fromhex(image)

    def save(self, slot: int | str, image: bytes) -> None:
        """Store the EEPROM of one slot; the file is replaced atomically."""
        self._images[str(slot)] = image.hex()
        if self._path is None:
            return
        make_private(self._path.parent)
        text = json.dumps({"identity": self._identity, "slots": self._images}, indent=1)
        temporary = self._path.with_name(self._path.name + ".new")
        with temporary.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self._path)
