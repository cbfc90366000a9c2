"""``joshua demonstrate``: record a data set from a scripted demonstrator in a simulated task.

Without ``--run``, each step waits for its frame. With ``--run``, the demonstrator leads the arm of a run, and
the recorder of that run records it.
"""

from __future__ import annotations

import argparse
import fcntl
import itertools
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SUMMARY = "record a data set of a scripted demonstrator at a simulated task"

#: Failed episodes in a row after which the command gives up.
MOST_FAILED = 20

#: Size of a picture in pixels.
WIDTH, HEIGHT = 128, 96


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``joshua demonstrate``."""
    parser.add_argument(
        "environment",
        metavar="ENVIRONMENT",
        nargs="?",
        default="",
        help="id of the task, with or without joshua/",
    )
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", nargs="?", help="of the data set; must not exist"
    )
    parser.add_argument(
        "--run",
        dest="shows",
        action="store_true",
        help="have the demonstrator of a run show episodes to its recorder",
    )
    parser.add_argument("--system", default="", help="file or process id, where several runs have one")
    parser.add_argument("--episodes", type=_positive, default=50, metavar="N", help="how many (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="of the first episode (default 0)")
    parser.add_argument("--cameras", default="", metavar="NAMES", help="cameras to record, such as top,wrist")
    parser.add_argument("--width", type=_positive, help=f"of a picture in pixels (default {WIDTH})")
    parser.add_argument("--height", type=_positive, help=f"of a picture in pixels (default {HEIGHT})")
    parser.add_argument(
        "--noise", type=float, default=0.0, metavar="RAD", help="spread of the goals, so that episodes differ"
    )
    parser.add_argument(
        "--recoveries",
        type=_share,
        default=0.0,
        metavar="SHARE",
        help="of the episodes, those that show how to recover from errors, 0 to 1 (default 0)",
    )
    parser.add_argument("--randomise", action="store_true", help="vary the physics from episode to episode")


def run(arguments: argparse.Namespace) -> int:
    """Record the data set. Exit code 0; 1 if it fails, 2 for a wrong argument, 3 without joshua-dataset."""
    from joshua.api.specs import EpisodeWriterSpec
    from joshua.features import EpisodeError
    from joshua.tools import ExitCode, load_registry, load_target, nearest_first

    if arguments.shows:
        return _show(arguments)
    if not arguments.environment or arguments.folder is None:
        sys.stderr.write("joshua demonstrate: name a task and a folder, or --run for a run that records\n")
        return ExitCode.INVALID

    from joshua_mujoco_sim.envs import make_environment
    from joshua_mujoco_sim.envs.experts import EXPERTS
    from joshua_mujoco_sim.opengl import RenderingError

    name = arguments.environment
    name = name if "/" in name else f"joshua/{name}"
    if name not in EXPERTS:
        known = ", ".join(nearest_first(name, tuple(EXPERTS)))
        sys.stderr.write(f"joshua demonstrate: {name} has no demonstrator: choose {known}\n")
        return ExitCode.INVALID
    writer = load_registry().find(EpisodeWriterSpec, "data_store", "FORMAT_HUGGINGFACE")
    if writer is None:
        sys.stderr.write("joshua demonstrate: requires joshua-dataset: install it, ./run --with dataset\n")
        return ExitCode.NOT_INSTALLED
    if arguments.folder.exists():
        sys.stderr.write(f"joshua demonstrate: {arguments.folder} exists: name another folder\n")
        return ExitCode.INVALID
    cameras = tuple(part for part in arguments.cameras.split(",") if part)
    for option in () if cameras else ("width", "height"):
        if getattr(arguments, option) is not None:
            sys.stderr.write(
                f"joshua demonstrate: --{option} has no effect without pictures: add --cameras\n"
            )
            return ExitCode.INVALID
    shown: dict[str, Any] = (
        {"width": arguments.width or WIDTH, "height": arguments.height or HEIGHT} if cameras else {}
    )
    try:
        environment = make_environment(
            name,
            action_mode="absolute",
            randomise=arguments.randomise,
            observation_mode="both" if cameras else "state",
            cameras=cameras,
            **shown,
            disable_env_checker=True,
        ).unwrapped
    except ValueError as error:
        sys.stderr.write(f"joshua demonstrate: {error}\n")
        return ExitCode.INVALID
    try:
        recorder = Recorder(environment, load_target(writer.implementation), arguments.folder, cameras)
        expert = EXPERTS[name](
            environment, noise_rad=arguments.noise, seed=arguments.seed, recoveries=arguments.recoveries
        )
        failed = _record(recorder, expert, TASKS[name], arguments)
    except (EpisodeError, RenderingError) as error:
        sys.stderr.write(f"joshua demonstrate: {error}\n")
        return ExitCode.FAILED
    finally:
        environment.close()
    lost = f"; {failed} that failed are left out" if failed else ""
    sys.stdout.write(f"{recorder.written} episodes in {arguments.folder}{lost}\n")
    return ExitCode.OK if recorder.written == arguments.episodes else ExitCode.FAILED


class Recorder:
    """Writes episodes of an environment: joints and goals in rad, pictures, reward by term, success, objects.

    Args:
        environment: a single one with actions in rad; writer: an ``EpisodeWriter``; folder: of the data set.
        cameras: of the environment.
    """

    def __init__(self, environment: Any, writer: Any, folder: Path, cameras: tuple[str, ...]) -> None:
        from joshua.features import ACTION, STATE, DatasetLayout, Feature, FeatureSet, camera_key

        self._environment, self._cameras = environment, {name: camera_key(name) for name in cameras}
        self.fps = environment.metadata["render_fps"]
        model = environment.state.model
        joints = tuple(model.actuator(index).name for index in range(model.nu))
        self._objects = environment.task.objects
        _, info = environment.reset(seed=0)
        terms = [term.name for term in environment.task.rewards]
        features = [
            Feature.joints(STATE, joints),
            Feature.joints(ACTION, joints),
            Feature("next.reward", "float32", (1,)),
            Feature("next.success", "float32", (1,)),
            Feature("next.done", "bool", (1,)),
            *(Feature(f"info.reward.{name}", "float32", (1,)) for name in terms),
            *(Feature(f"info.{key}", "float32", value.shape) for key, value in info["objects"].items()),
        ]
        if cameras:
            space = environment.observation_space
            features += [Feature.picture(key, *space[name].shape[:2]) for name, key in self._cameras.items()]
        self._writer = writer(DatasetLayout(folder, "SO-ARM100", self.fps, FeatureSet(features)))
        self._writer.open()

    @property
    def written(self) -> int:
        """Number of written episodes."""
        return int(self._writer.episodes)

    def episode(self, expert: Any, seed: int, task: str) -> bool:
        """Run one episode to some steps after its success, else drop it. Raises EpisodeError.

        The environment ends its episode with the success: ``next.done`` marks this step, and later ones earn
        nothing.
        """
        import numpy as np
        from joshua.features import ACTION, STATE, Frame

        from joshua_mujoco_sim.envs.experts import AFTER_STEPS

        environment, state = self._environment, self._environment.state
        environment.reset(seed=seed)
        expert.scatter(seed)
        expert.reset()
        observation, info = environment.observe()
        succeeded, last = False, environment.task.max_steps - 1
        for step in itertools.count():
            frame: dict[str, Any] = {STATE: state.qpos[0, :6].astype(np.float32)}
            frame |= {key: observation[name] for name, key in self._cameras.items()}
            frame |= {f"info.{key}": value.astype(np.float32) for key, value in info["objects"].items()}
            observation, reward, terminated, _, info = environment.step(expert.act())
            success = info["is_success"]
            frame[ACTION] = state.ctrl[0].astype(np.float32)
            earns = 0.0 if succeeded else 1.0
            frame["next.reward"] = np.array([earns * reward], np.float32)
            frame["next.success"] = np.array([success], np.float32)
            frame["next.done"] = np.array([terminated and not succeeded])
            frame |= {
                f"info.reward.{name}": np.array([earns * value], np.float32)
                for name, value in info["reward_terms"].items()
            }
            self._writer.add_frame(Frame(round(step * 1e9 / self.fps), frame))
            if success and not succeeded:
                succeeded, last = True, step + AFTER_STEPS
            if step >= last or (terminated and not succeeded):
                break
        if succeeded:
            self._writer.end_episode(task)
        else:
            self._writer.drop_episode()
        return succeeded

    def close(self) -> None:
        """Close the data set."""
        self._writer.close()


#: Task descriptions in the data set.
TASKS = {
    "joshua/SoArm100Reach-v0": "Reach the goal.",
    "joshua/SoArm100PickPlace-v0": "Put the cube on the goal.",
}


def _record(recorder: Recorder, expert: Any, task: str, arguments: argparse.Namespace) -> int:
    failed = in_a_row = 0
    seed = arguments.seed
    try:
        while recorder.written < arguments.episodes and in_a_row < MOST_FAILED:
            if recorder.episode(expert, seed, task):
                in_a_row = 0
                sys.stdout.write(f"episode {recorder.written} of {arguments.episodes}\n")
            else:
                failed, in_a_row = failed + 1, in_a_row + 1
            seed += 1
    except KeyboardInterrupt:
        sys.stdout.write("stopped; the open episode is left out\n")
    finally:
        recorder.close()
    return failed


SIMULATOR, RECORDER = "/simulation", "/data_store"

#: Longest wall time of a demonstration or a scene, and of a new run until each of its topics has a message.
LONGEST_S, FIRST_MESSAGES_S = 300.0, 15.0


def _show(arguments: argparse.Namespace) -> int:
    """Run the demonstrator of a run and keep successful episodes with its recorder."""
    from joshua.tools import CallError, ExitCode, RunningSystem

    if arguments.environment:
        sys.stderr.write("joshua demonstrate: with --run, the file of the run says the task and the folder\n")
        return ExitCode.INVALID
    kept = failed = in_a_row = 0
    seed = arguments.seed
    try:
        systems = [RunningSystem.find(arguments.system)] if arguments.system else RunningSystem.all()
        systems = [item for item in systems if item.has(SIMULATOR) and item.has(RECORDER)]
        if len(systems) != 1:
            raise CallError(
                "unknown-node",
                "several runs have a simulation and a recorder: name one with --system FILE"
                if systems
                else "no run has a simulation and a recorder: start one, such as "
                "`joshua --config data_store_demonstrations.pbtxt`, then run this in another terminal",
            )
        with _alone(systems[0]):
            while kept < arguments.episodes and in_a_row < MOST_FAILED:
                if _one(systems[0], seed, patience_s=FIRST_MESSAGES_S if seed == arguments.seed else 0.0):
                    kept, in_a_row = kept + 1, 0
                    sys.stdout.write(f"episode {kept} of {arguments.episodes}\n")
                    sys.stdout.flush()
                else:
                    failed, in_a_row = failed + 1, in_a_row + 1
                seed += 1
    except CallError as error:
        sys.stderr.write(f"joshua demonstrate: {error}\n")
        return ExitCode.FAILED
    except KeyboardInterrupt:
        sys.stdout.write("stopped\n")
    lost = f"; {failed} that failed are left out" if failed else ""
    sys.stdout.write(f"{kept} episodes recorded{lost}\n")
    return ExitCode.OK if kept == arguments.episodes else ExitCode.FAILED


@contextmanager
def _alone(system: Any) -> Iterator[None]:
    """Keep other commands from showing scenes to the same run. Raises CallError."""
    from joshua.tools import CallError

    try:
        descriptor = os.open(system.path, os.O_RDONLY)
    except OSError as error:
        raise CallError("unreachable", f"{system.name}, has ended: start it again") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise CallError(
                "refused",
                f"another `joshua demonstrate --run` shows episodes to {system.name}: wait until it ends, or "
                "stop it with Ctrl-C",
            ) from error
        yield
    finally:
        os.close(descriptor)


def _one(system: Any, seed: int, patience_s: float) -> bool:
    """Demonstrate one scene. Raises CallError; the recorder discards partial episodes."""
    until_s = time.monotonic() + patience_s
    _call(system, SIMULATOR, "set_scene", {"seed": seed}, until_s)
    _wait(system, ("ready",))
    _call(system, RECORDER, "start", {}, until_s)
    recorded = False
    try:
        system.call(SIMULATOR, "show", {})
        recorded = _wait(system, ("succeeded", "failed")) == "succeeded"
    finally:
        system.call(RECORDER, "keep" if recorded else "discard", {}, timeout_s=60.0)
    return recorded


def _call(system: Any, node: str, verb: str, request: dict[str, Any], until_s: float) -> None:
    """Call a node, again while it starts: a recorder waits for a message on every topic. Raises CallError."""
    from joshua.tools import CallError

    while True:
        try:
            system.call(node, verb, request, timeout_s=30.0)
            return
        except CallError as error:
            if error.code not in ("refused", "not-running") or time.monotonic() > until_s:
                raise
            time.sleep(0.2)


def _wait(system: Any, phases: tuple[str, ...]) -> str:
    """Wait for a phase of the demonstrator. Raises CallError."""
    from joshua.tools import CallError

    until_s = time.monotonic() + LONGEST_S
    while time.monotonic() < until_s:
        phase = str(system.call(SIMULATOR, "progress", {})["phase"])
        if phase in phases:
            return phase
        time.sleep(0.02)
    raise CallError("timeout", f"the demonstrator is not {' or '.join(phases)} after {LONGEST_S:g} s")


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0.0 <= share <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a share from 0 to 1, such as 0.5")
    return share


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number from 1 on")
    return int(text)
