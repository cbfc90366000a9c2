"""Remotes on loopback for unmodified libraries: moto's S3, Google's storage, the Hub, each behind a proxy."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from cutting_proxy import CuttingProxy, cutting
from gcs_server import GcsServer
from hub_server import TOKEN, HubServer
from serving import serving

#: What the libraries would otherwise take from this machine or its network.
NOWHERE = {
    "AWS_CONFIG_FILE": "/nonexistent",
    "AWS_SHARED_CREDENTIALS_FILE": "/nonexistent",
    "AWS_EC2_METADATA_DISABLED": "true",
    "AWS_DEFAULT_REGION": "us-east-1",
    "GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT": "false",
    "HF_HUB_DISABLE_XET": "1",
    "HF_HUB_DISABLE_TELEMETRY": "1",
}

SECRET = "s3cretS3cretS3cret"


@dataclass
class Remote:
    """A remote and the way to it.

    Attributes:
        url: of a folder for data sets, without a slash at its end; proxy: in front of the server.
        server: of the kind of the remote; environment: that the library needs.
    """

    url: str
    proxy: CuttingProxy
    server: Any
    environment: dict[str, str]


@contextlib.contextmanager
def s3() -> Iterator[Remote]:
    """S3 with one bucket, ``bucket``."""
    import boto3
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    port = server.get_host_and_port()[1]
    try:
        with cutting(port) as proxy:
            keys = {"AWS_ACCESS_KEY_ID": "testing", "AWS_SECRET_ACCESS_KEY": SECRET}
            endpoint = {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.port}"}
            client = boto3.client(
                "s3",
                endpoint_url=f"http://127.0.0.1:{port}",
                region_name="us-east-1",
                aws_access_key_id="testing",
                aws_secret_access_key=SECRET,
            )
            client.create_bucket(Bucket="bucket")
            yield Remote("s3://bucket", proxy, client, NOWHERE | endpoint | keys)
    finally:
        server.stop()


@contextlib.contextmanager
def gs() -> Iterator[Remote]:
    """Google Cloud Storage with one bucket, ``bucket``."""
    server = GcsServer()
    server.buckets["bucket"] = {}
    with serving(server), cutting(server.port) as proxy:
        endpoint = {"STORAGE_EMULATOR_HOST": f"http://127.0.0.1:{proxy.port}"}
        yield Remote("gs://bucket", proxy, server, NOWHERE | endpoint)


@contextlib.contextmanager
def hub() -> Iterator[Remote]:
    """The Hub with no repository."""
    server = HubServer()
    with serving(server), cutting(server.port) as proxy:
        endpoint = {"HF_ENDPOINT": f"http://127.0.0.1:{proxy.port}", "HF_TOKEN": TOKEN}
        yield Remote("hf://datasets/me", proxy, server, NOWHERE | endpoint)


KINDS = {"s3": s3, "gs": gs, "hf": hub}


def use(remote: Remote, monkeypatch: pytest.MonkeyPatch) -> None:
    """Point the libraries of this process to a remote."""
    for name, value in remote.environment.items():
        monkeypatch.setenv(name, value)
    if remote.url.startswith("hf:"):  # which reads its environment at import
        import huggingface_hub.constants as constants

        endpoint = remote.environment["HF_ENDPOINT"]
        monkeypatch.setattr(constants, "ENDPOINT", endpoint)
        monkeypatch.setattr(
            constants, "HUGGINGFACE_CO_URL_TEMPLATE", endpoint + "/{repo_id}/resolve/{revision}/{filename}"
        )
        monkeypatch.setattr(constants, "HF_HUB_DISABLE_XET", True)
