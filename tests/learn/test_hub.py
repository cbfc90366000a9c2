"""Checkpoints from the hub, by the hub's own client: what is fetched, and what a refusal says."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from checkpoints import write_checkpoint
from hub import Hub, hub


@pytest.fixture(scope="module")
def served() -> Iterator[Hub]:
    with hub() as state:
        yield state


def policy(served: Hub, home: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs ``joshua policy``."""
    chosen = {
        "HF_ENDPOINT": served.endpoint,
        "HF_HOME": str(home),
        "HF_HUB_OFFLINE": "0",
        "HF_HUB_DISABLE_XET": "1",
    }
    return subprocess.run(
        [sys.executable, "-m", "joshua", "policy", *words],
        capture_output=True,
        text=True,
        env={**os.environ, **chosen, **environment},
        timeout=120,
        check=False,
    )


def test_a_checkpoint_is_fetched_once_and_then_known_offline(served: Hub, tmp_path: Path) -> None:
    served.folders["acme/act"] = write_checkpoint(tmp_path / "act")
    (served.folders["acme/act"] / "code.py").write_text("raise SystemExit")
    done = policy(served, tmp_path / "home", "fetch", "acme/act")
    assert done.returncode == 0, done.stderr
    assert not any("code.py" in path for path in served.asked)
    offline = policy(served, tmp_path / "home", "show", "acme/act", HF_ENDPOINT="http://127.0.0.1:9")
    assert offline.returncode == 0, offline.stderr
    assert "sees  observation.images.top  64 x 48    IDENTITY" in offline.stdout
    assert "does  action                  6 lerobot  MEAN_STD" in offline.stdout


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        (
            "acme/gated",
            (),
            "The hub refuses access to acme/gated (403): its owner must grant it. Ask for",
        ),
        ("acme/none", (), "The hub has no checkpoint acme/none, or it is private (401). Correct the name."),
        ("acme/plain", ("--revision", "v9"), "acme/plain has no revision 'v9' on the hub. Correct revision"),
        ("acme/pickled", (), "acme/pickled on the hub has its weights in pytorch_model.bin, a pickle"),
    ],
)
def test_a_refusal_says_what_to_do(
    served: Hub, tmp_path: Path, name: str, words: tuple[str, ...], said: str
) -> None:
    served.gated.add("acme/gated")
    served.folders["acme/plain"] = write_checkpoint(tmp_path / "plain")
    pickled: Any = write_checkpoint(tmp_path / "pickled")
    (pickled / "model.safetensors").rename(pickled / "pytorch_model.bin")
    served.folders["acme/pickled"] = pickled
    done = policy(served, tmp_path / "home", "fetch", name, *words)
    assert done.returncode == 1
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not any("pytorch_model.bin" in path for path in served.asked)


def test_the_token_is_sent_and_never_shown(served: Hub, tmp_path: Path) -> None:
    served.folders["acme/private"] = write_checkpoint(tmp_path / "private")
    served.private["acme/private"] = "hf_secret"
    refused = policy(served, tmp_path / "home", "fetch", "acme/private")
    assert "it is private (401)" in refused.stderr
    assert "HF_TOKEN" in refused.stderr
    wrong = policy(served, tmp_path / "home", "fetch", "acme/private", HF_TOKEN="hf_wrong")
    assert wrong.returncode == 1
    assert "hf_wrong" not in wrong.stdout + wrong.stderr
    done = policy(served, tmp_path / "home", "fetch", "acme/private", HF_TOKEN="hf_secret")
    assert done.returncode == 0, done.stderr
    assert "hf_secret" not in done.stdout + done.stderr


def test_without_a_network_the_message_says_how_to_bring_it_here(served: Hub, tmp_path: Path) -> None:
    for environment in ({"HF_ENDPOINT": "http://127.0.0.1:9"}, {"HF_HUB_OFFLINE": "1"}):
        done = policy(served, tmp_path / "home", "fetch", "acme/act", **environment)
        assert done.returncode == 1
        assert (
            "The hub cannot be reached, and acme/act was not downloaded to this machine before."
            in done.stderr
        )
        assert "run `joshua policy fetch acme/act`" in done.stderr
