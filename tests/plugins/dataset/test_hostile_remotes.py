"""Transfers of data sets: no name of a remote and no link of a folder leads out of the data set."""

from __future__ import annotations

from pathlib import Path

import hostile
import pytest
import small_dataset
from joshua_dataset.cloud.copies import is_safe, store_of
from joshua_dataset.cloud.download import download
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.store import Tally
from joshua_dataset.cloud.upload import upload
from joshua_dataset.reader import DatasetError


@pytest.mark.parametrize("name", [name for key, name in hostile.NAMES.items() if key != "folder"])
def test_no_name_of_a_remote_leads_out_of_the_folder(name: str) -> None:
    assert not is_safe(name)
    assert not is_safe(f"data/{name}")
    assert not is_safe(f"{name}/file.parquet")


def test_names_of_data_sets_are_taken() -> None:
    assert is_safe("meta/info.json")
    assert is_safe(f"videos/{small_dataset.TOP}/chunk-000/file-000.mp4")
    assert is_safe("SHA256SUMS")


def test_a_link_to_a_private_file_is_not_uploaded(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    folder, secret = tmp_path / "set", tmp_path / "id_rsa"
    small_dataset.write(folder)
    secret.write_text("private")
    (folder / "data/extra.bin").symlink_to(secret)
    store = store_of(f"memory://{tmp_path.name}/set")
    with pytest.raises(DatasetError, match=r"cannot be uploaded: the file '.*extra\.bin' is a symlink"):
        upload(folder, store, Tally())
    assert store.listing() == {}


@pytest.mark.parametrize("name", ["data", ".joshua", ".joshua/incoming", "meta/info.json"])
def test_a_download_writes_nothing_through_a_link(tmp_path: Path, name: str) -> None:
    pytest.importorskip("fsspec")
    victim, target = tmp_path / "victim", tmp_path / "there"
    small_dataset.write(tmp_path / "set")
    store = store_of(f"memory://{tmp_path.name}/set")
    upload(tmp_path / "set", store, Tally())
    hostile.fill(victim)
    before = hostile.manifest(victim)
    (target / name).parent.mkdir(parents=True)
    (target / name).symlink_to(victim if "." not in Path(name).suffix else victim / "info.json")
    with pytest.raises(RemoteError, match="is a symlink that leads outside"):
        download(store, target, Tally())
    assert hostile.manifest(victim) == before
