"""Uploads by runs: the settings of the block, the preset, and recordings that are sent as they are made."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import remotes
from eventually import eventually
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua.tools import check, render_text
from joshua_dataset.reader import Dataset
from same_process import joshua_here
from small_dataset import write

ROOT = Path(__file__).resolve().parents[3]

CAMERA = """
robot {
  perceptions {
    node { node_name: "camera_top" node_id: 3
      publishers { data_type: IMAGE topic_name: "/top/image_raw" publish_rate_hz: 20 } }
    perception_type: PERCEPTION_CAMERA
    mock_camera_config { width: 64 height: 48 fps: 20 }
  }
}
general { mode: MODE_DATA_STORE name: "cell" id: "cell" }
ai { data_store {
  format: FORMAT_HUGGINGFACE dataset_name: "waves" fps: 20
  %s
} }
"""


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id, {"JOSHUA_RUN_DIR": str(tmp_path / "runs")})
        yield program
        program.close()


def cell(folder: Path, fields: str) -> str:
    path = folder / "cell.pbtxt"
    path.write_text(CAMERA % fields)
    return str(path)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ('storage: STORAGE_CLOUD local_path: "d"', "STORAGE_CLOUD requires remote_url, the address"),
        (
            'storage: STORAGE_CLOUD remote_url: "hf://datasets/me/d"',
            "A recording is written to this machine before it is uploaded",
        ),
        (
            'storage: STORAGE_CLOUD remote_url: "hf://datasets/me/d" operation: DATA_STORE_REPLAY',
            "A replay reads the data set from this machine, and needs local_path",
        ),
        (
            'storage: STORAGE_LOCAL local_path: "d" remote_url: "s3://b/d" operation: DATA_STORE_UPLOAD',
            "An upload goes to a remote",
        ),
        (
            'storage: STORAGE_CLOUD local_path: "d" remote_url: "s4://b/d"',
            "remote_url cannot be used: s4:// is a scheme that no installed library supports",
        ),
        (
            'storage: STORAGE_LOCAL local_path: "d" remote_url: "s3://b/d" upload: AT_END',
            "upload has no effect: it says when a recording with storage: STORAGE_CLOUD is",
        ),
        (
            'storage: STORAGE_CLOUD local_path: "d" remote_url: "s3://me:hunter2hunter2@b/d"',
            "remote_url cannot be used: the address contains a password or a token",
        ),
        (
            'storage: STORAGE_CLOUD local_path: "d" remote_url: "s3://b/d?secret=hunter2hunter2"',
            "remote_url cannot be used: the address contains a password or a token",
        ),
    ],
)
def test_settings_that_do_not_fit(fields: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    result = check(cell(tmp_path, fields))
    texts = [f"{item.message} {item.found}" for item in result.diagnostics]
    sources = {item.position.file: CAMERA % fields for item in result.diagnostics if item.position}
    shown = " ".join(render_text(result.diagnostics, sources).split())
    assert expected in shown
    assert "remote_url:" in shown or "local_path" in shown  # the line of the file
    assert "hunter2" not in shown + "".join(texts)


@pytest.mark.parametrize("option", ["--emulate", "--sim"])
def test_the_preset_uploads(option: str, joshua: JoshuaProgram, tmp_path: Path) -> None:
    write(tmp_path / "here")
    preset = str(shutil.copy(ROOT / "configs/data_store_upload.pbtxt", tmp_path))
    with remotes.hub() as remote:
        joshua.environment.update(remote.environment)
        words = ("--config", preset, option, "--set", f'ai.data_store.local_path="{tmp_path / "here"}"')
        done = joshua(*words, timeout_s=90)
        assert done.returncode == 0, done.stderr
        assert "hf://datasets/my-name/so_arm100_demos: 9 of 9 files moved" in done.stdout + done.stderr
        files = remote.server.repositories["my-name/so_arm100_demos"].branches["main"]
        assert files["meta/info.json"] == (tmp_path / "here/meta/info.json").read_bytes()
        remote.server.refusal = 401
        refused = joshua(*words, timeout_s=90)
        assert refused.returncode == 1
        assert "refuses the credentials, which are missing, wrong or expired" in refused.stderr
        assert remote.environment["HF_TOKEN"] not in refused.stdout + refused.stderr


def test_each_episode_is_uploaded_while_the_next_is_recorded(joshua: JoshuaProgram, tmp_path: Path) -> None:
    there = tmp_path / "there"
    fields = f'storage: STORAGE_CLOUD local_path: "waves" remote_url: "{there.as_uri()}"'
    process = started(joshua, cell(tmp_path, f"{fields} upload: AFTER_EACH_EPISODE auto_start: true"))
    assert "is kept" in record(joshua, "keep")
    eventually(lambda: (there / "meta/info.json").exists(), "the first episode is uploaded")
    assert Dataset.read(there).episodes == 1
    shutil.move(there, tmp_path / "away")
    there.write_text("a disk that went away")
    record(joshua, "start")
    assert "is kept" in record(joshua, "keep")  # a remote that is gone stops no recording
    there.unlink()
    shutil.move(tmp_path / "away", there)
    _, errors = joshua.stop(process)
    assert process.returncode == 0, errors
    assert "the recording continues, and the next upload retries" in errors
    assert Dataset.read(there).episodes == 2
    assert (there / "SHA256SUMS").exists()


def test_a_recording_is_uploaded_at_its_end(joshua: JoshuaProgram, tmp_path: Path) -> None:
    there = tmp_path / "there"
    fields = f'storage: STORAGE_CLOUD local_path: "waves" remote_url: "{there.as_uri()}" resume: true'
    ends = "num_episodes: 2 episode_duration_s: 0.4 reset_duration_s: 0.1 auto_start: true"
    done = joshua("--config", cell(tmp_path, f"{fields} {ends}"), timeout_s=90)
    assert done.returncode == 0, done.stderr
    assert Dataset.read(there).episodes == 2
    shutil.rmtree(there)
    there.write_text("a disk that went away")
    done = joshua("--config", cell(tmp_path, f"{fields} {ends}"), timeout_s=90)
    assert done.returncode == 1
    shown = done.stdout + done.stderr
    assert f"Every episode is in {tmp_path / 'waves'}: run `joshua dataset upload" in shown
    assert Dataset.read(tmp_path / "waves").episodes == 4


def test_ctrl_c_keeps_and_uploads_the_open_episode(joshua: JoshuaProgram, tmp_path: Path) -> None:
    there = tmp_path / "there"
    fields = f'storage: STORAGE_CLOUD local_path: "waves" remote_url: "{there.as_uri()}"'
    process = started(joshua, cell(tmp_path, f"{fields} auto_start: true"))
    eventually(lambda: "frames: 0 " not in status(joshua), "there are frames")
    _, errors = joshua.stop(process)
    assert process.returncode == 0, errors
    assert f"uploading to {there.as_uri()}; press Ctrl-C twice within 2 s to leave it" in errors
    assert Dataset.read(there).episodes == 1


def started(joshua: JoshuaProgram, path: str) -> subprocess.Popen[str]:
    """A run that records its first episode."""
    process = joshua.start("--config", path)
    eventually(lambda: "recording" in status(joshua), "the first episode is recorded")
    return process


def status(joshua: JoshuaProgram) -> str:
    words = ("record", "status")
    return joshua_here(*words, environment=joshua.environment, folder=joshua.folder).stdout


def record(joshua: JoshuaProgram, word: str) -> str:
    found = joshua("record", word)
    assert found.returncode == 0, found.stderr
    return found.stdout
