"""Every check of the repository. ``nox`` runs the default sessions; ``nox -s NAME`` runs one.

Another interpreter: ``nox -s tests --force-python 3.13``.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

import nox
from nox.command import CommandFailed

nox.needs_version = ">=2024.10.9"
nox.options.default_venv_backend = "venv"
nox.options.reuse_venv = "yes"
nox.options.error_on_missing_interpreters = True
nox.options.sessions = ["lint", "types", "proto", "docs", "tests"]

ROOT = Path(__file__).parent
CONSTRAINTS = ROOT / "constraints.txt"
PYPROJECT = nox.project.load_toml("pyproject.toml")
IN_CI = os.environ.get("CI", "").lower() in ("1", "true")

CORE = "joshua-core"
PLUGIN = "joshua-plugins"
CORE_SOURCES = "joshua-core/src"
EXAMPLES = sorted(str(path.parent.relative_to(ROOT)) for path in ROOT.glob("docs/examples/*/pyproject.toml"))
PLUGINS = sorted(str(path.parent.relative_to(ROOT)) for path in ROOT.glob("joshua-plugins/*/pyproject.toml"))

# Tests that run several at a time: they compute, or wait for time-outs of devices, and their outcome does
# not depend on how busy the machine is. All others run one after the other, because they judge rates, motions
# and latencies, which a busy machine spoils; so does what is new.
SIDE_BY_SIDE = (
    "tests/core/cli",
    "tests/core/config",
    "tests/core/devices",
    "tests/core/messages",
    "tests/core/mock",
    "tests/core/models",
    "tests/core/modes",
    "tests/core/plan",
    "tests/core/planner",
    "tests/core/plugins",
    "tests/core/schema",
    "tests/core/supervisor",
    "tests/core/testing",
    "tests/core/textproto",
    "tests/core/test_rooms.py",
    "tests/end_to_end/test_bad_input.py",
    "tests/end_to_end/test_calibrat*.py",
    "tests/end_to_end/test_lidar_window.py",
    "tests/end_to_end/test_set_up.py",
    "tests/plugins/*/test_bus_tools.py",
    "tests/plugins/*/test_calibration_transaction.py",
    "tests/plugins/*/test_doctor.py",
    "tests/plugins/*/test_fa*.py",
    "tests/plugins/*/test_find_port.py",
    "tests/plugins/*/test_lines.py",
    "tests/plugins/*/test_motors_setup.py",
    "tests/plugins/*/test_parsers.py",
    "tests/plugins/calibration",
    "tests/plugins/serial",
    "tests/plugins/servo",
    "tests/presets",
    "tests/tools",
)


@nox.session
def lint(session: nox.Session) -> None:
    """Style, format, the oldest supported Python, and what must never be committed."""
    install(session, *group("lint"))
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("vermin", "--quiet", "--no-tips", "--violations", "--target=3.10-", CORE_SOURCES)
    session.run("python", "tools/check_tree.py")


@nox.session
def types(session: nox.Session) -> None:
    """Mypy over everything in one run; pyproject.toml says how strict each part is."""
    install(session, *group("types", "test"), *editable(f"{CORE}[dds]", *EXAMPLES, *PLUGINS))
    # By file: in a folder of tests that is named as a whole, mypy would name the shared modules twice.
    test_files = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("*.py"))
    sources = [f"{plugin}/src" for plugin in PLUGINS] + [f"{example}/src" for example in EXAMPLES]
    session.run("mypy", CORE_SOURCES, *sources, "tools", "noxfile.py", *test_files, *session.posargs)


@nox.session
def proto(session: nox.Session) -> None:
    """Regenerates the schema's Python modules; with ``-- --check`` (and in CI) only compares them."""
    install(session, *group("proto"))
    arguments = session.posargs or (["--check"] if IN_CI else [])
    session.run("python", "tools/generate_schema.py", *arguments)


@nox.session
def docs(session: nox.Session) -> None:
    """Generates the reference pages and builds the site into ``site/``; a warning is an error."""
    install(session, *group("docs"), *editable(CORE, f"{PLUGIN}/calibration"))
    session.run("python", "tools/generate_docs.py")
    session.run("mkdocs", "build", "--strict", "--quiet", *session.posargs, env={"NO_MKDOCS_2_WARNING": "1"})


@nox.session
def tests(session: nox.Session) -> None:
    """The test suite; arguments after ``--`` go to pytest, which then runs once, one test after the other."""
    install(session, *group("test"), *editable(f"{CORE}[dds]", *EXAMPLES, *PLUGINS))
    if session.posargs:
        session.run("pytest", *session.posargs)
        return
    beside = [str(path.relative_to(ROOT)) for pattern in SIDE_BY_SIDE for path in sorted(ROOT.glob(pattern))]
    workers = min(2 * (os.cpu_count() or 1), 8)  # most of what they do is to wait
    failed: CommandFailed | None = None
    try:
        session.run("pytest", f"--numprocesses={workers}", "--dist=worksteal", *beside)
    except CommandFailed as error:  # what fails here must not hide what fails in the other part
        failed = error
    session.run("pytest", "tests", *(f"--ignore={path}" for path in beside))
    if failed is not None:
        raise failed


@nox.session
def soak(session: nox.Session) -> None:
    """Ten minutes of teleoperation on bad lines; ``-- SECONDS`` for another length."""
    install(session, *group("test"), *editable(f"{CORE}[dds]", *PLUGINS))
    session.run("python", "tests/soak/teleoperation.py", *session.posargs)


@nox.session
def mjx(session: nox.Session) -> None:
    """The simulation's models on JAX, which is too heavy for every run of the tests."""
    needed = ("pytest", "pytest-timeout", "hypothesis", "mujoco-mjx", "jax")
    install(session, *needed, *editable(CORE, f"{PLUGIN}/mujoco-sim"))
    session.run(
        "pytest",
        *("-p", "no:cacheprovider", "-W", "default", "--timeout", "600"),
        *(session.posargs or ["tests/plugins/mujoco_sim/test_mjx.py"]),
    )


@nox.session
def bench(session: nox.Session) -> None:
    """Runs the benchmarks and prints their figures; ``-- NAME …`` runs those whose name contains NAME."""
    install(session, *group("test"), *editable(f"{CORE}[dds]", *PLUGINS))
    scripts = sorted(path for path in (ROOT / "tests/benchmarks").glob("*.py") if path.name[0] != "_")
    if session.posargs:
        scripts = [path for path in scripts if any(word in path.name for word in session.posargs)]
    if not scripts:
        session.error("no benchmark matches; see tests/benchmarks")
    for script in scripts:
        session.run("python", str(script.relative_to(ROOT)))


@nox.session(reuse_venv=False)
def pins(session: nox.Session) -> None:
    """Resolves everything afresh and writes the versions into constraints.txt."""
    groups = list(PYPROJECT["dependency-groups"])
    session.install(*group(*groups), *editable(f"{CORE}[dds]", *EXAMPLES, *PLUGINS))
    session.run("python", "tools/write_constraints.py")


def group(*names: str) -> list[str]:
    """Lists the requirements of dependency groups of pyproject.toml."""
    return list(nox.project.dependency_groups(PYPROJECT, *names))


def editable(*folders: str) -> list[str]:
    """Lists pip arguments that install distributions of this repository in place."""
    return [argument for folder in folders for argument in ("-e", f"./{folder}")]


def install(session: nox.Session, *arguments: str) -> None:
    """Installs with the tested pins, once: a second run with the same request costs nothing."""
    files = [CONSTRAINTS, *(ROOT / folder / "pyproject.toml" for folder in (CORE, *EXAMPLES, *PLUGINS))]
    request = [*arguments, str(ROOT), sys.version, *(path.read_text(encoding="utf-8") for path in files)]
    digest = hashlib.sha256("\0".join(request).encode()).hexdigest()
    stamp = Path(session.virtualenv.location) / "installed.sha256"
    if stamp.is_file() and stamp.read_text(encoding="ascii") == digest:
        return
    session.install("-c", str(CONSTRAINTS), *arguments)
    # Compiled once here: where PYTHONDONTWRITEBYTECODE is set, every process would compile the sources anew.
    if sources := [f"{item.partition('[')[0]}/src" for item in arguments if item.startswith("./")]:
        session.run("python", "-m", "compileall", "-q", *sources)
    if not {"-R", "--no-install"} & set(sys.argv):  # with these nox leaves the install out
        stamp.write_text(digest, encoding="ascii")
