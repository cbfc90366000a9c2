"""Nine of ten models that other people have packed are driven, and the documentation says which are not."""

from __future__ import annotations

import os
import re
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path

import pytest
from foreign_models import Trial, model_files, try_model
from results_page import PAGE, replaced, rows_by_package, section, share, tables

PINS = Path(__file__).resolve().parents[2] / "constraints-models.txt"

WANTED_SHARE = 0.9

#: Models that another processor may judge differently, because a joint ends at the edge of its tolerance.
MOST_FLIPPED = 3

REWRITE = "nox -s models -- --write-page"


@pytest.fixture(scope="session")
def versions() -> dict[str, str]:
    """The pinned version of each package."""
    lines = PINS.read_text(encoding="utf-8").splitlines()
    return dict(line.split("==") for line in lines if "==" in line)


@pytest.fixture(scope="session")
def trials(versions: dict[str, str]) -> list[Trial]:
    """The trials of all models, a few at a time."""
    jobs = [(package, str(path)) for package in versions for path in model_files(package)]
    workers = max(2, os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return list(pool.map(try_model, *zip(*jobs, strict=True)))


def test_the_pinned_packages_are_installed(versions: dict[str, str]) -> None:
    assert versions == {package: metadata.version(package) for package in versions}


def test_nine_of_ten_models_are_driven(trials: list[Trial]) -> None:
    refused = [f"{trial.path}: {'; '.join(trial.reasons)}" for trial in trials if trial.outcome == "refused"]
    assert share(trials) >= WANTED_SHARE, "\n".join(refused)


def test_every_package_has_a_model(trials: list[Trial], versions: dict[str, str]) -> None:
    assert set(Counter(trial.package for trial in trials if trial.outcome == "driven")) == set(versions)


def test_each_refusal_names_one_actuator_and_why(trials: list[Trial]) -> None:
    refusals = [refusal for trial in trials for refusal in trial.refusals]
    assert refusals
    for refusal in refusals:
        assert refusal.actuator
        assert re.fullmatch(r"(is|has|pushes|drives|pulls|computes|reaches) .+", refusal.reason), refusal
        assert str(refusal) == f"{refusal.actuator} {refusal.reason}"
    for trial in trials:
        indices = [refusal.index for refusal in trial.refusals]
        assert len(set(indices)) == len(indices)


def test_the_page_shows_these_results(
    trials: list[Trial], versions: dict[str, str], request: pytest.FixtureRequest
) -> None:
    page, results = PAGE.read_text(encoding="utf-8"), tables(trials, versions)
    if request.config.getoption("--write-page"):
        PAGE.write_text(replaced(page, results), encoding="utf-8")
        return
    written, found = rows_by_package(section(page)), rows_by_package(results)
    assert [*written] == [*found], REWRITE
    flipped = 0
    for package, (version, models, driven, _, *others) in found.items():
        old_version, old_models, old_driven, _, *old_others = written[package]
        assert [version, models, *others] == [old_version, old_models, *old_others], REWRITE
        flipped += abs(int(driven) - int(old_driven))
    assert flipped <= MOST_FLIPPED, REWRITE
