from pathlib import Path

import pytest
from joshua_emulator.eeprom_store import EepromStore, EepromStoreError


def test_images_come_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "eeprom.json"
    EepromStore(path, "A").save(2, b"\x01\x02")
    again = EepromStore(path, "A")
    again.load()
    assert again.image(2) == b"\x01\x02"
    assert again.image(1) is None
    assert [file.name for file in path.parent.iterdir()] == ["eeprom.json"]


def test_a_file_of_another_device_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "eeprom.json"
    EepromStore(path, "A").save(0, b"\x01")
    with pytest.raises(EepromStoreError, match=r"belongs to the device 'A', not to 'B'.*a file of its own"):
        EepromStore(path, "B").load()


def test_a_broken_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "eeprom.json"
    for text in ("{", "[]", '{"identity": "A", "slots": {"0": "zz"}}'):
        path.write_text(text)
        with pytest.raises(EepromStoreError, match="remove it to start from factory settings"):
            EepromStore(path, "A").load()
