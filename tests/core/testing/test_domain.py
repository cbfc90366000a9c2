from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack

import pytest
from joshua.testing.domain import reserved_domain


def test_domains_reserved_at_the_same_time_differ() -> None:
    with ExitStack() as stack:
        domains = [stack.enter_context(reserved_domain()) for _ in range(10)]
    assert len(set(domains)) == 10
    assert all(1 <= domain <= 101 for domain in domains)


def test_a_domain_rests_before_it_is_reserved_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    seen = []
    for _ in range(101):
        with reserved_domain() as domain:
            seen.append(domain)
    assert len(set(seen)) == 101
    with reserved_domain() as domain:
        assert domain in seen[:5], "the file system may tell times of the same moment from one another badly"


def test_another_process_does_not_get_a_reserved_domain(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    code = "from joshua.testing.domain import reserved_domain\nwith reserved_domain() as d: print(d)"
    with ExitStack() as stack:
        mine = {stack.enter_context(reserved_domain()) for _ in range(100)}
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
        )
        assert {int(result.stdout)} == set(range(1, 102)) - mine
        stack.enter_context(reserved_domain())
        with pytest.raises(RuntimeError, match="tests have reserved all domains: see the locks in "):
            stack.enter_context(reserved_domain())


def test_the_fixture_sets_the_environment(joshua_domain_id: int) -> None:
    assert os.environ["ROS_DOMAIN_ID"] == str(joshua_domain_id)


def test_the_pytest_plugin_imports_nothing_heavy() -> None:
    code = (
        "import sys; import joshua.testing.pytest_plugin; "
        "sys.exit(', '.join({'numpy', 'pydantic', 'zenoh', 'google', 'pluggy.x'} & set(sys.modules)) or 0)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 0, result.stderr
