"""Fixtures of the transport tests."""

from second_user import second_user
from transport_fixtures import (
    dds_spec,
    domain_id,
    eventually,
    opener,
    program,
    restore_distro,
    router,
    spec,
    zenoh_spec,
)

__all__ = [
    "dds_spec",
    "domain_id",
    "eventually",
    "opener",
    "program",
    "restore_distro",
    "router",
    "second_user",
    "spec",
    "zenoh_spec",
]
