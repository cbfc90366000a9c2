"""Settings that this machine cannot carry are named before the middleware meets them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from joshua.plan import TlsSpec, TransportSettings
from joshua.transport import TransportError, open_transport, prepare_transport
from joshua.transport.zenoh.settings import require_certificates


def secure(folder: Path, **files: str) -> TransportSettings:
    names = {"root_ca_file": "ca.pem", "certificate_file": "a.pem", "private_key_file": "a.key", **files}
    tls = TlsSpec(**{field: str(folder / name) for field, name in names.items()})
    return TransportSettings(listen_endpoints=("tls/localhost:7447",), tls=tls)


@pytest.fixture
def certificates(tmp_path: Path) -> Path:
    """A folder with a certificate that signs itself, its key, another key, and one with a password."""
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
    command += ["-nodes", "-subj", "/CN=robot", "-keyout", "a.key", "-out", "a.pem"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    (tmp_path / "ca.pem").write_bytes((tmp_path / "a.pem").read_bytes())
    (tmp_path / "garbage.pem").write_text("no certificate\n")
    for name, protection in (
        ("other.key", serialization.NoEncryption()),
        ("locked.key", serialization.BestAvailableEncryption(b"secret")),
    ):
        key = ec.generate_private_key(ec.SECP256R1())
        pem = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, protection)
        (tmp_path / name).write_bytes(pem)
    return tmp_path


@pytest.mark.parametrize(
    ("files", "text"),
    [
        ({"root_ca_file": "none.pem"}, "root_ca_file: .*none.pem cannot be read: No such file"),
        ({"root_ca_file": "garbage.pem"}, "root_ca_file: .*garbage.pem holds no certificate in PEM form"),
        ({"certificate_file": "garbage.pem"}, "garbage.pem and .*a.key are no certificate and its key"),
        ({"private_key_file": "other.key"}, "and the key that belongs to it"),
        ({"private_key_file": "locked.key"}, "locked.key is protected by a password. Use a key without one"),
        ({"private_key_file": "."}, "private_key_file: .* cannot be read: Is a directory"),
    ],
)
def test_certificates_that_cannot_be_used_are_named(certificates: Path, files: dict[str, str], text: str):
    require_certificates(secure(certificates))
    spec = secure(certificates, **files)
    for use in (open_transport, prepare_transport):
        with pytest.raises(TransportError, match=text):
            use(spec)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can hide shared memory from a process")
def test_a_machine_without_shared_memory_goes_on_with_a_warning(zenoh_spec: TransportSettings):
    code = f"""
import logging, sys, time
logging.basicConfig(format="%(levelname)s %(message)s")
from joshua.plan import TransportSettings
from joshua.transport import open_transport
from joshua.transport import prepare_transport
spec = TransportSettings.model_validate_json({zenoh_spec.model_dump_json()!r})
router = prepare_transport(spec)
transport = open_transport(spec)
while not transport.connected:  # the link may take longer than the opening
    time.sleep(0.01)
print(router.description, transport.connected)
transport.close(); router.close()
"""

    hidden = 'mount -t tmpfs -o ro,size=64k tmpfs /dev/shm && exec "$@"'
    command = ["unshare", "-m", "sh", "-c", hidden, "sh", sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "unshare" in result.stderr:
        pytest.skip("this system gives no mount namespace")
    assert result.returncode == 0, result.stderr
    assert result.stdout == f"hosts the Zenoh router on {zenoh_spec.listen_endpoints[0]} True\n"
    assert result.stderr.count("WARNING no shared memory") == 1
    assert "df -h /dev/shm" in result.stderr
