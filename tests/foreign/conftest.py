"""The option that writes the results into the page."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--write-page``."""
    parser.addoption("--write-page", action="store_true", help="write the results into the page of the docs")
