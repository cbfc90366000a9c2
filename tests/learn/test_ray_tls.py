"""A real Ray cluster of two nodes with TLS and a token, and strangers that it refuses."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from small_dataset import write

TLS_FILES = ("RAY_TLS_SERVER_CERT", "RAY_TLS_SERVER_KEY", "RAY_TLS_CA_CERT")

HEAD = """
import sys
from ray_nodes import add_worker, started
nodes = started(1)
add_worker(nodes)
print("READY", nodes.address, flush=True)
sys.stdin.read()
nodes.shutdown()
"""

NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


def openssl(*words: str) -> None:
    subprocess.run(["openssl", *words], check=True, capture_output=True)


def variables(folder: Path, name: str) -> dict[str, str]:
    """Makes an authority and a certificate; returns the variables of a process that has them."""
    authority, key, own = folder / f"{name}-ca.crt", folder / f"{name}.key", folder / f"{name}.crt"
    authority_key, request, names = folder / f"{name}-ca.key", folder / f"{name}.csr", folder / "names"
    names.write_text("subjectAltName=IP:127.0.0.1,DNS:localhost")
    valid = ("-days", "1")
    made = ("-keyout", str(authority_key), "-out", str(authority))
    openssl("req", "-x509", *NEW_KEY, *valid, "-subj", f"/CN={name}-ca", *made)
    openssl("req", *NEW_KEY, "-subj", f"/CN={name}", "-keyout", str(key), "-out", str(request))
    signing = ("-CA", str(authority), "-CAkey", str(authority_key), "-CAcreateserial", "-extfile", str(names))
    openssl("x509", "-req", "-in", str(request), *signing, *valid, "-out", str(own))
    files = zip(TLS_FILES, map(str, (own, key, authority)), strict=True)
    return {"RAY_USE_TLS": "1", **dict(files)}


def environment(**more: str) -> dict[str, str]:
    usual = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    return {**usual, "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "of-this-cluster-only", **more}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tls")


@pytest.fixture(scope="module")
def ours(folder: Path) -> dict[str, str]:
    return variables(folder, "ours")


@pytest.fixture(scope="module")
def address(ours: dict[str, str]) -> Iterator[str]:
    head = subprocess.Popen(
        [sys.executable, "-c", HEAD],
        env=environment(**ours),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert head.stdout is not None
    found = next(line.split()[1] for line in head.stdout if line.startswith("READY"))
    yield found
    head.communicate()


def checked(folder: Path, address: str, **more: str) -> tuple[int, str]:
    """Checks a data set on the cluster; returns the exit code and what was said."""
    if not (folder / "set").exists():
        write(folder / "set")
    done = subprocess.run(
        [sys.executable, "-m", "joshua", "dataset", "check", str(folder / "set"), "--ray", address],
        env=environment(**more),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout + done.stderr


def test_whoever_has_certificate_and_token_works_on_the_cluster(
    folder: Path, address: str, ours: dict[str, str]
) -> None:
    code, said = checked(folder, address, **ours)
    assert code == 0, said


def test_strangers_are_refused(folder: Path, address: str, ours: dict[str, str]) -> None:
    code, said = checked(folder, address)
    assert (code, f"the Ray cluster at {address} has TLS, and this process does not" in said) == (1, True), (
        said
    )
    code, said = checked(folder, address, **variables(folder, "theirs"))
    assert (code, "has a certificate that RAY_TLS_CA_CERT did not sign" in said) == (1, True), said
    code, said = checked(folder, address, **ours, RAY_AUTH_TOKEN="guessed")
    assert (code, f"the Ray cluster at {address} refuses the token of this process" in said) == (1, True), (
        said
    )
