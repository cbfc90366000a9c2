"""Fixtures of the DDS tests."""

from transport_fixtures import dds_spec, domain_id, eventually, opener, program, restore_distro

__all__ = ["dds_spec", "domain_id", "eventually", "opener", "program", "restore_distro"]
