"""Clusters whose TLS is not that of this process are refused at once, without Ray."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

import pytest
from certificates import Authority
from joshua_jobs.executor import JobError
from joshua_ray.addresses import TLS_FILES, refuse_other_tls


def variables(authority: Authority, name: str) -> dict[str, str]:
    values = (*authority.issue(name), authority.file)
    return {"RAY_USE_TLS": "1", **dict(zip(TLS_FILES, values, strict=True))}


@contextmanager
def head(tls: dict[str, str] | None) -> Iterator[str]:
    """Accepts connections, with TLS for both sides where it has files of it; yields its address."""
    context = None
    if tls is not None:
        certificate, key, authority = (tls[name] for name in TLS_FILES)
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=authority)
        context.load_cert_chain(certificate, key)
        context.verify_mode = ssl.CERT_REQUIRED
        context.set_alpn_protocols(["h2"])

    def serve() -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            with suppress(OSError), connection:
                if context is not None:
                    context.wrap_socket(connection, server_side=True).close()
                else:
                    connection.recv(100)
                    connection.sendall(b"\x00\x00\x12\x04\x00\x00\x00\x00\x00")  # settings of HTTP/2

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = Thread(target=serve)
        thread.start()
        try:
            yield f"127.0.0.1:{server.getsockname()[1]}"
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()


def test_equal_tls_is_accepted(tmp_path: Path) -> None:
    ours = Authority(tmp_path, "ours")
    with head(variables(ours, "head")) as address:
        refuse_other_tls(address, variables(ours, "driver"))
    with head(None) as address:
        refuse_other_tls(address, {})


@pytest.mark.parametrize(
    ("server", "client", "said"),
    [
        ("ours", "", "has TLS, and this process does not. Set RAY_USE_TLS=1 and RAY_TLS_SERVER_CERT, "),
        ("", "ours", "has no TLS, but RAY_USE_TLS=1 is set. Start its nodes with RAY_USE_TLS=1"),
        ("ours", "theirs", "has a certificate that RAY_TLS_CA_CERT did not sign ("),
    ],
)
def test_other_tls_is_refused(tmp_path: Path, server: str, client: str, said: str) -> None:
    known = {name: Authority(tmp_path, name) for name in ("ours", "theirs")}
    with (
        head(variables(known[server], "head") if server else None) as address,
        pytest.raises(JobError) as caught,
    ):
        refuse_other_tls(address, variables(known[client], "driver") if client else {})
    assert str(caught.value).startswith(f"the Ray cluster at {address} {said}")


def test_files_of_tls_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    broken = variables(Authority(tmp_path, "ours"), "driver")
    Path(broken["RAY_TLS_SERVER_KEY"]).write_text("")
    with head(None) as address, pytest.raises(JobError, match="the files of TLS cannot be used: "):
        refuse_other_tls(address, broken)
