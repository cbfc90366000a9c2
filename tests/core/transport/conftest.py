"""Fixtures of the transport tests."""

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
    "spec",
    "zenoh_spec",
]
