"""Data sets at remotes: S3, Google Cloud Storage and the Hub on loopback, and any scheme of fsspec.

Why one file: its tests share three servers, which take seconds to start.
"""

from __future__ import annotations

import argparse
import errno
import json
import shutil
import stat
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
import remotes
from gcs_server import GcsServer
from hub_server import TOKEN, HubServer
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_dataset.cloud import store as store_module
from joshua_dataset.cloud.copies import SUMS, store_of
from joshua_dataset.cloud.download import download
from joshua_dataset.cloud.errors import RemoteError, StoppedError
from joshua_dataset.cloud.ledger import names_of
from joshua_dataset.cloud.node import tally_of
from joshua_dataset.cloud.store import Tally
from joshua_dataset.cloud.upload import upload
from joshua_dataset.commands import dataset, transfers
from joshua_dataset.files import Files
from joshua_dataset.reader import Dataset
from joshua_dataset.writer import LeRobotWriter
from remotes import SECRET, Remote, use
from serving import serving
from small_dataset import add_episode, layout, write

BIG = "data/extra.bin"

# Of gcsfs, which sends each part of an upload from memory, and of the Hub's client.
pytestmark = [
    pytest.mark.filterwarnings("ignore:Sending a large body:ResourceWarning"),
    pytest.mark.filterwarnings("ignore:Use 'content=:DeprecationWarning"),
]


@pytest.fixture(scope="module", params=sorted(remotes.KINDS))
def shared(request: pytest.FixtureRequest) -> Iterator[Remote]:
    with remotes.KINDS[request.param]() as remote:
        yield remote


@pytest.fixture
def remote(shared: Remote, monkeypatch: pytest.MonkeyPatch) -> Iterator[Remote]:
    use(shared, monkeypatch)
    yield shared
    shared.proxy.cuts, shared.proxy.answer_cuts, shared.proxy.refuses = [], [], False


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "here")
    return tmp_path / "here"


@pytest.fixture
def url(remote: Remote, request: pytest.FixtureRequest) -> str:
    """A folder of this test."""
    return f"{remote.url}/{request.node.originalname.replace('_', '-')}"


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    dataset.add_arguments(parser)
    return int(dataset.run(parser.parse_args(words)))


def content(folder: Path) -> dict[str, bytes]:
    """The files of a data set."""
    names = [*names_of(folder), "meta/info.json"]
    return {name: (folder / name).read_bytes() for name in names if name not in (SUMS, "README.md")}


def enlarge(folder: Path, size: int = 20 << 20, last: bytes = b"") -> None:
    """Add a file that travels in several parts; the Hub takes a content once, whatever its name."""
    (folder / BIG).write_bytes(bytes(range(256)) * (size // 256) + last)


def append(folder: Path, length: int = 4) -> None:
    writer = LeRobotWriter(layout(folder, resume=True))
    writer.open()
    add_episode(writer, "wave", length)
    writer.close()


def test_a_data_set_goes_there_and_back(
    remote: Remote, url: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("upload", str(folder), url) == 0
    assert " files moved, " in capsys.readouterr().out
    assert run("upload", str(folder), url) == 0  # from what the ledger and the remote know
    assert "files were there already" in capsys.readouterr().out
    shutil.rmtree(folder / ".joshua")
    assert run("upload", str(folder), url) == 0  # from the checksums of the remote alone
    assert "files were there already" in capsys.readouterr().out
    back = tmp_path / "back"
    assert run("download", url, str(back)) == 0
    assert content(back) == content(folder)
    assert Dataset.read(back).episodes == 2
    assert run("download", url, str(back)) == 0
    assert "files were there already" in capsys.readouterr().out
    append(folder)
    assert run("upload", str(folder), url) == 0
    sent = capsys.readouterr().out
    count = len(content(folder)) + (remote.url[:2] != "hf")
    # the episode's table, video and row; statistics, info and, but on the Hub, the checksums
    assert f"{6 if remote.url[:2] != 'hf' else 5} of {count} files moved" in sent
    assert run("download", url, str(back)) == 0
    assert Dataset.read(back).episodes == 3
    assert content(back) == content(folder)


def test_connections_that_are_cut(remote: Remote, url: str, folder: Path, tmp_path: Path) -> None:
    enlarge(folder, 12 << 20)
    cut = remote.proxy.cut
    remote.proxy.cuts = [100_000, 3 << 20]
    upload(folder, store_of(url), Tally())
    assert remote.proxy.cut > cut
    cut = remote.proxy.cut
    remote.proxy.answer_cuts = [3 << 20]
    download(store_of(url), tmp_path / "back", Tally())
    assert remote.proxy.cut > cut
    assert content(tmp_path / "back") == content(folder)


def test_a_network_that_stays_away(
    remote: Remote, url: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if remote.url.startswith("gs"):
        pytest.skip("gcsfs itself tries for half a minute")
    remote.proxy.refuse()
    assert run("upload", str(folder), url, "--patience", "0.1") == 1
    error = capsys.readouterr().err
    assert "failed: " in error
    assert "check the network connection" in error
    assert SECRET not in error
    assert TOKEN not in error


def test_an_upload_that_was_stopped_goes_on(remote: Remote, url: str, folder: Path) -> None:
    sent = Tally(stopping=lambda: sent.moved_files >= 3)
    with pytest.raises(StoppedError):
        upload(folder, store_of(url), sent, jobs=1)
    again = Tally()
    done = upload(folder, store_of(url), again)
    # the Hub names contents only in a commit; what it holds is not sent twice
    assert done.moved_files <= done.files - (3 if remote.url[:2] != "hf" else 0)
    if isinstance(remote.server, HubServer):
        assert len(remote.server.puts) == len(set(remote.server.puts))


def stop_within(folder: Path, url: str, after: int = 11 << 20) -> None:
    """Send a part of a large file."""
    stopped = Tally(stopping=lambda: stopped.moved_bytes > after)
    with pytest.raises(StoppedError):
        upload(folder, store_of(url), stopped, jobs=1)


def test_a_large_file_that_was_stopped_goes_on(
    remote: Remote, url: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_dataset.cloud.bucket.PART", 5 << 20)  # the least that S3 takes
    enlarge(folder, 22 << 20)
    stop_within(folder, url)
    begun = folder / ".joshua/uploads.json"
    if not url.startswith("s3"):  # which lists the uploads that have begun
        assert stat.S_IMODE(begun.stat().st_mode) == 0o600  # it has addresses that need no credentials
    again = Tally()
    upload(folder, store_of(url), again)
    assert again.moved_bytes < 12 << 20
    assert again.done_bytes == again.bytes
    assert not begun.exists()
    download(store_of(url), tmp_path / "back", Tally())
    assert content(tmp_path / "back") == content(folder)


def test_a_large_file_whose_session_has_expired_starts_anew(
    remote: Remote, url: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_dataset.cloud.bucket.PART", 5 << 20)
    enlarge(folder, 22 << 20, b"anew")
    stop_within(folder, url)
    if isinstance(remote.server, GcsServer):
        remote.server.sessions.clear()
    elif isinstance(remote.server, HubServer):
        remote.server.parts.clear()
    else:
        pytest.skip("S3 tells which uploads it has")
    again = Tally()
    upload(folder, store_of(url), again)
    assert again.moved_bytes > 22 << 20
    assert again.done_bytes == again.bytes
    assert upload(folder, store_of(url), Tally()).moved_files == 0


def test_a_download_that_was_stopped_goes_on(
    url: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "CHUNK", 1 << 20)
    for name in ("bucket", "hub"):
        monkeypatch.setattr(f"joshua_dataset.cloud.{name}.CHUNK", 1 << 20)
    enlarge(folder, 8 << 20)
    upload(folder, store_of(url), Tally())
    stopped = Tally(stopping=lambda: stopped.moved_bytes >= 5 << 20)
    back = tmp_path / "back"
    with pytest.raises(StoppedError):
        download(store_of(url), back, stopped, jobs=1)
    assert not (back / "meta/info.json").exists()  # nobody takes it for complete
    again = Tally()
    download(store_of(url), back, again)
    assert again.moved_bytes < 4 << 20
    assert content(back) == content(folder)
    assert [path.name for path in (back / ".joshua").iterdir()] == ["transfers.json"]


def test_a_remote_with_another_data_set(
    url: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("upload", str(folder), url) == 0
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    info = json.loads((folder / "meta/info.json").read_text())
    info["fps"], info["total_episodes"] = 20, 1
    (other / "meta/info.json").write_text(json.dumps(info))
    capsys.readouterr()
    assert run("upload", str(other), url) == 1
    error = capsys.readouterr().err
    assert f"{url} holds a data set that differs: fps is 20 on this machine and 10 at the remote." in error
    assert run("download", url, str(other)) == 1
    assert (
        "differs: fps is 20 on this machine and 10 at the remote. Name another folder"
        in capsys.readouterr().err
    )
    fewer = tmp_path / "fewer"
    write(fewer, lengths=(3,))
    assert run("upload", str(fewer), url) == 1
    assert f"has 2 episodes, but {fewer} has 1: an upload would lose some" in capsys.readouterr().err
    anew = tmp_path / "anew"
    write(anew, lengths=(4, 2, 2))
    assert run("upload", str(anew), url) == 1
    assert "has a different episode 0: data/chunk-000/file-000.parquet differs" in capsys.readouterr().err
    assert run("download", url, str(anew)) == 1
    assert f"{anew} has 3 episodes, but {url} has 2" in capsys.readouterr().err
    assert run("upload", str(fewer), url, "--replace") == 0
    back = tmp_path / "back"
    assert run("download", url, str(back)) == 0
    assert content(back) == content(fewer)


def test_what_does_not_exist(remote: Remote, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("download", f"{remote.url}/nowhere", str(folder.parent / "back")) == 1
    assert "nowhere holds no data set: it has no meta/info.json" in capsys.readouterr().err
    if remote.url.startswith("hf"):
        return
    scheme = remote.url.partition("://")[0]
    for words in (("upload", str(folder), f"{scheme}://none/x"), ("download", f"{scheme}://none/x", "back")):
        assert run(*words) == 1
        expected = f"{scheme}://none does not exist: create the bucket, or correct remote_url"
        assert expected in capsys.readouterr().err


def test_credentials_that_are_refused(
    remote: Remote,
    url: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if isinstance(remote.server, GcsServer | HubServer):
        for status, expected in ((401, "missing, wrong or expired"), (403, "lack read or write permission")):
            remote.server.refusal = status
            assert run("upload", str(folder), url) == 1
            remote.server.refusal = 0
            error = capsys.readouterr().err
            assert expected in error
            assert "set HF_TOKEN" in error or "set GOOGLE_APPLICATION_CREDENTIALS" in error
    if remote.url.startswith("s3"):
        monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
        monkeypatch.delenv("AWS_ACCESS_KEY_ID")
        assert run("upload", str(folder), url) == 1
        assert "no credentials for s3://: set AWS_ACCESS_KEY_ID" in capsys.readouterr().err
    if remote.url.startswith("hf"):
        monkeypatch.setenv("HF_TOKEN", "hf_wrongwrongwrong")
        assert run("upload", str(folder), url) == 1
        error = capsys.readouterr().err
        assert "refuses the credentials, which are missing, wrong or expired: set HF_TOKEN" in error
        assert "wrongwrong" not in error


def test_a_file_that_arrives_damaged_is_sent_again(remote: Remote, url: str, folder: Path) -> None:
    if isinstance(remote.server, GcsServer):
        remote.server.damage = {"a-file-that-arrives-damaged-is-sent-again/meta/stats.json"}
    elif isinstance(remote.server, HubServer):
        remote.server.damage = {"meta/stats.json"}
    else:
        pytest.skip("moto keeps what it receives")
    upload(folder, store_of(url.replace("test-", "")), Tally())
    assert not remote.server.damage
    done = upload(folder, store_of(url.replace("test-", "")), Tally())
    assert done.moved_files == 0


def test_the_hub_shows_a_data_set_of_lerobot(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with remotes.hub() as remote:
        use(remote, monkeypatch)
        upload(folder, store_of("hf://datasets/me/data"), Tally())
        repository = remote.server.repositories["me/data"]
        assert repository.private
        assert repository.tags == {"v3.0": "main"}  # without it LeRobot does not load a data set
        assert b"- LeRobot" in repository.branches["main"]["README.md"]
        upload(folder, store_of("hf://datasets/me/data@try/some/folder"), Tally())
        assert "some/folder/meta/info.json" in repository.branches["try"]
        assert "some/folder/meta/info.json" not in repository.branches["main"]


def test_any_scheme_of_fsspec(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "there"
    assert run("upload", str(folder), there.as_uri()) == 0
    assert run("upload", str(folder), "memory://any/scheme") == 0
    assert run("download", "memory://any/scheme", str(tmp_path / "back")) == 0
    assert content(tmp_path / "back") == content(folder)
    capsys.readouterr()
    damaged = there / "data/chunk-000/file-001.parquet"
    damaged.write_bytes(damaged.read_bytes()[::-1])
    assert run("download", there.as_uri(), str(tmp_path / "back2")) == 1
    assert "data/chunk-000/file-001.parquet arrived damaged 3 times" in capsys.readouterr().err
    assert run("upload", str(folder), there.as_uri(), "--replace") == 0
    assert "file:" in capsys.readouterr().out
    assert run("download", there.as_uri(), str(tmp_path / "back2")) == 0
    assert content(tmp_path / "back2") == content(folder)


def test_a_folder_of_something_else_is_left_alone(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = (tmp_path / "there").as_uri()
    run("upload", str(folder), there)
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter.txt").write_text("dear")
    assert run("download", there, str(other)) == 1
    assert f"{other} is not empty and holds no data set. Name another folder" in capsys.readouterr().err
    assert run("upload", str(other), there) == 1
    assert f"{other} is not a data set: it has no meta/info.json" in capsys.readouterr().err
    (folder / ".joshua/open").mkdir(parents=True, exist_ok=True)
    assert run("download", there, str(folder)) == 1
    assert f"Run `joshua dataset repair {folder}` first" in capsys.readouterr().err


def test_names_that_leave_the_folder_are_not_fetched(folder: Path, tmp_path: Path) -> None:
    import fsspec

    memory = fsspec.filesystem("memory")
    upload(folder, store_of("memory://hostile/data"), Tally())
    memory.pipe_file("/hostile/data/.ssh/key", b"x")
    memory.pipe_file("/hostile/data/a\\..\\b", b"x")
    download(store_of("memory://hostile/data"), tmp_path / "deep/back", Tally())
    assert content(tmp_path / "deep/back") == content(folder)
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["back"]


def test_a_full_disk_keeps_what_is_complete(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(Files):
        left = 4

        def sync(self, path: Path) -> None:
            self.left -= 1
            if self.left < 0:
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            super().sync(path)

    upload(folder, store_of("memory://full/disk"), Tally())
    back = tmp_path / "back"
    with pytest.raises(RemoteError, match=r"the disk of .* is full: 4 of 9 files are complete\. Free some"):
        download(store_of("memory://full/disk"), back, Tally(), jobs=1, files=Full())
    again = Tally()
    download(store_of("memory://full/disk"), back, again)
    assert again.moved_files == 5
    assert content(back) == content(folder)
    usage: Any = type("Usage", (), {"free": 1000})
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage)
    with pytest.raises(RemoteError, match=r"has 1\.0 kB left, and the download needs 119\.9 kB"):
        download(store_of("memory://full/disk"), tmp_path / "third", Tally())


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("s4://bucket/x", "s4:// is a scheme that no installed library supports; allowed: hf://"),
        ("bucket/x", "has no scheme such as s3://"),
        ("hf://models/me/x", "does not name a data set on the Hub; allowed: hf://datasets/NAME/DATA"),
        ("s3://", "does not name a folder"),
        ("s3://bucket/../x", "does not name a folder"),
        ("s3://AKIAIOSFODNN7EXAMPLE:wJalrXUtnFEMI@bucket/x", "contains a password or a token"),
        ("sftp://me:wJalrXUtnFEMI@host/x", "contains a password or a token"),
        ("hf://datasets/me/x?token=wJalrXUtnFEMI", "contains a password or a token"),
        ("s3://bucket/hf_wJalrXUtnFEMI", "contains a password or a token"),
    ],
)
def test_an_address_that_cannot_be_used(
    address: str, expected: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("upload", str(folder), address) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "wJalrXUtnFEMI" not in error


def test_a_scheme_whose_library_is_missing(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_dataset.cloud.address.find_spec", lambda name: None)
    for scheme, path in (("s3", "b/x"), ("gs", "b/x"), ("hf", "datasets/me/x")):
        assert run("upload", str(folder), f"{scheme}://{path}") == 3
        error = capsys.readouterr().err
        assert f"{scheme}:// requires " in error
        assert f"dataset[{scheme}]'" in error


class _Expired(BaseHTTPRequestHandler):
    """An S3 that finds every token expired."""

    def do_GET(self) -> None:
        body = b"<Error><Code>ExpiredToken</Code><Message>The provided token has expired.</Message></Error>"
        self.send_response(400)
        self.send_header("Content-Type", "application/xml")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Keep the terminal clean."""


def test_a_token_that_has_expired(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Expired)
    keys = {"AWS_ACCESS_KEY_ID": "testing", "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_SESSION_TOKEN": SECRET}
    with serving(server):
        endpoint = {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.server_address[1]}"}
        for name, value in (remotes.NOWHERE | keys | endpoint).items():
            monkeypatch.setenv(name, value)
        assert run("upload", str(folder), "s3://bucket/x") == 1
    error = capsys.readouterr().err
    assert "s3://bucket/x refuses the credentials, which have expired: set AWS_ACCESS_KEY_ID" in error
    assert SECRET not in error


def test_ctrl_c_says_how_to_go_on(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(tally: Tally) -> None:
        if tally.moved_files == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(transfers._Screen, "show", lambda self, tally: interrupted(tally))
    monkeypatch.setattr(store_module, "REPORT_PERIOD_S", 0)
    there = (tmp_path / "there").as_uri()
    assert run("upload", str(folder), there, "--jobs", "1") == 130
    expected = "upload: stopped. 3 of 10 files are complete. Run the same command again to resume\n"
    assert capsys.readouterr().err == f"joshua dataset {expected}"


def test_progress_reaches_the_run(folder: Path, tmp_path: Path) -> None:
    store = "joshua_dataset.node:DataStore"
    context = RecordingContext(
        NodeSpec(name="data_store", kind=NodeKind.SERVICE, behaviour=store, implementation=store)
    )
    upload(folder, store_of((tmp_path / "there").as_uri()), tally_of(context, lambda: False))
    progress = context.progresses["upload"]
    assert (progress.current, progress.unit) == (progress.total, "MB")
    assert progress.rate
    assert progress.remaining_s == 0
