"""Other people's models: where their packages keep them, and whether JOSHUA drives their joints.

A model is tried as its user would: a file that lists every joint is checked and planned, and the device of
the plan moves the joints. Only time is faster.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Literal
from xml.parsers import expat

import mujoco
import numpy as np
import numpy.typing as npt
from joshua.api import Actuator, DeviceError, FieldError
from joshua.api.nodes import ActuatorFacts, load_implementation
from joshua.devices.context import ActuatorContext
from joshua.plan import NodeKind, NodeSpec
from joshua.tools import plan
from joshua_mujoco_sim.actuator_kinds import actuator_count
from joshua_mujoco_sim.drivable import Refusal, drivables
from joshua_mujoco_sim.model_facts import model_facts
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.settings import SimulationSettings
from joshua_mujoco_sim.world import World, leave_world, shared_world

FloatArray = npt.NDArray[np.float64]

#: A joint counts as driven that reaches these fractions of its range within the tolerance, in simulated time.
GOALS = (0.2, 0.8)
TOLERANCE = 0.05
MOTION_S = 3.0

#: Time of a joint that a velocity drive moves, whose limit may be below its range in three seconds.
SLOW_MOTION_S = 10.0

#: A joint whose drives apply this fraction of their force towards the goal holds as far as they can.
SATURATED = 0.97

#: Shortest time step of a model that is tried, because a motion takes long with a shorter one.
SHORTEST_STEP_S = 0.0005

#: Longest trial of a model, in real time.
TRIAL_S = 120.0

#: Simulated time between two looks at the joints.
LOOK_S = 0.05

DIVERGES = "the simulation diverges while the joints move"

Outcome = Literal["fragment", "nothing to drive", "driven", "refused"]


@dataclass(frozen=True)
class Trial:
    """What became of one model.

    Attributes:
        package: distribution; path: of the file in it.
        outcome: ``fragment`` if MuJoCo does not load the file by itself.
        reasons: why it is refused, one sentence each; or why it does not load.
        refusals: actuators that cannot follow positions, each with the reason.
        joints: number of joints that were driven; held: those of them that stopped at the limit of their
            force; touching: those that something in the model stopped.
        duration_s: of the trial, in real time.
    """

    package: str
    path: str
    outcome: Outcome
    reasons: tuple[str, ...] = ()
    refusals: tuple[Refusal, ...] = ()
    joints: int = 0
    held: int = 0
    touching: int = 0
    duration_s: float = 0.0


def model_files(package: str) -> Iterator[Path]:
    """Find the MJCF and URDF files of an installed package, relative to where it is installed."""
    for file in sorted(metadata.distribution(package).files or ()):
        if file.suffix.lower() in (".xml", ".mjcf", ".urdf") and _root(Path(str(file.locate()))) in ROOTS:
            yield Path(str(file))


#: Elements that begin a file of a model, or a part of one.
ROOTS = ("mujoco", "mujocoinclude", "robot")


def _root(path: Path) -> str:
    """Return the first element of an XML file; "" if it has none."""
    found: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda name, _attributes: found.append(name)
    with path.open("rb") as stream:
        while not found and (part := stream.read(4096)):
            try:
                parser.Parse(part)
            except expat.ExpatError:
                break
    return found[0] if found else ""


def try_model(package: str, relative: str) -> Trial:
    """Load a model, check a file with all of its joints, and drive them."""
    began_s = time.monotonic()
    path = Path(str(metadata.distribution(package).locate_file(relative)))
    trial = Attempt(package, relative, path).run()
    return Trial(**{**vars(trial), "duration_s": time.monotonic() - began_s})


@dataclass
class Attempt:
    """The trial of one file."""

    package: str
    relative: str
    path: Path
    ends_s: float = field(default_factory=lambda: time.monotonic() + TRIAL_S)

    def run(self) -> Trial:
        """Try the model."""
        mujoco.set_mju_user_warning(lambda _text: None)
        with tempfile.TemporaryDirectory() as folder:
            try:
                facts = model_facts(str(self.path), folder, ())  # which the check below asks for again
            except FieldError as error:
                return self._unloadable(str(error))
            if not facts.actuators:
                return self._idle()
            return self._drive(Path(folder), list(facts.actuators))

    def _unloadable(self, reason: str) -> Trial:
        """MuJoCo itself must refuse the file, too."""
        try:
            mujoco.MjModel.from_xml_path(str(self.path))
        except ValueError:
            return self._trial("fragment", reasons=(reason,))
        return self._trial("refused", reasons=(reason,))

    def _idle(self) -> Trial:
        """No joint can be driven, which is right if it has none but muscles, thrusters and adhesion."""
        model = load_model(str(self.path))
        refusals = drivables(model).refusals
        if not _takes_positions(model):
            return self._trial("nothing to drive", refusals=refusals)
        return self._trial("refused", reasons=tuple(map(str, refusals)), refusals=refusals)

    def _drive(self, folder: Path, names: list[str]) -> Trial:
        file = folder / "robot.pbtxt"
        file.write_text(configuration(self.path, names), encoding="utf-8")
        result = plan(file)
        if result.plan is None:
            return self._trial("refused", reasons=tuple(error.message for error in result.errors))
        arm = next(node for node in result.plan.nodes if node.kind is NodeKind.ACTUATOR)
        with Driver(arm, names, self.ends_s) as driver:
            refusals = drivables(driver.model).refusals
            step_s = driver.model.opt.timestep
            if step_s < SHORTEST_STEP_S:
                reason = f"not tried: with its time step of {1000 * step_s:g} ms, a motion takes too long"
                return self._trial("refused", reasons=(reason,), refusals=refusals)
            try:
                reasons = tuple(driver.failures())
            except DeviceError:  # its numbers differ between processors
                return self._trial("refused", reasons=(DIVERGES,), refusals=refusals)
            except TooLongError as error:
                return self._trial("refused", reasons=(str(error),), refusals=refusals)
        return self._trial(
            "refused" if reasons else "driven",
            reasons=reasons,
            refusals=refusals,
            joints=len(names),
            held=len(driver.held),
            touching=len(driver.touching),
        )

    def _trial(
        self,
        outcome: Outcome,
        *,
        reasons: tuple[str, ...] = (),
        refusals: tuple[Refusal, ...] = (),
        joints: int = 0,
        held: int = 0,
        touching: int = 0,
    ) -> Trial:
        return Trial(self.package, self.relative, outcome, reasons, refusals, joints, held, touching)


#: Transmissions and dynamics of actuators that no position belongs to: thrusters, adhesion, muscles.
APART = (mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_BODY)


def _takes_positions(model: mujoco.MjModel) -> bool:
    """Whether the model has an actuator of a joint or tendon that is no muscle."""
    return any(
        mujoco.mjtTrn(model.actuator_trntype[index]) not in APART
        and mujoco.mjtDyn(model.actuator_dyntype[index]) != mujoco.mjtDyn.mjDYN_MUSCLE
        for index in range(actuator_count(model))
    )


def configuration(model: Path, joints: list[str]) -> str:
    """Return a file with all joints of a model."""
    return f"""
general {{ mode: MODE_SIMULATION robot_type: "foreign" name: "foreign" id: "foreign" }}
simulation {{ mode: OFFSCREEN on_divergence: DIVERGENCE_STOP_RUN model_path: {json.dumps(str(model))} }}
robot {{
  actions {{
    node {{
      node_name: "arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }}
    }}
    action_type: ACTION_SINGLE
    sim_config {{ actuators: {json.dumps(joints)} }}
  }}
}}
"""


class TooLongError(Exception):
    """A trial takes longer than the tests can wait."""


class Driver:
    """Drives the joints of a planned simulated device, in simulated time.

    Args:
        spec: of the device; names: of its joints; ends_s: on the monotonic clock.

    Attributes:
        model: the compiled model.
        held: joints that stopped at the limit of their force; touching: joints that reach their goals only
            without contacts, or alone.
    """

    def __init__(self, spec: NodeSpec, names: list[str], ends_s: float) -> None:
        facts = spec.facts_as(ActuatorFacts)
        implementation, settings = load_implementation(spec, Actuator)
        self._arm: Actuator = implementation(settings, ActuatorContext(facts))
        self._simulation = SimulationSettings.model_validate(facts.simulation).world()
        self._names = names
        self._low = np.array([joint.min_rad for joint in facts.joints])
        self._span = np.array([joint.max_rad for joint in facts.joints]) - self._low
        self._ends_s = ends_s
        self.held: set[str] = set()
        self.touching: set[str] = set()

    def __enter__(self) -> Driver:
        self._world: World = shared_world(self._simulation)
        self._world.pause()  # only the steps below run
        self._arm.connect()
        self.model = self._world.physics.model
        self._group = self._world.physics.group(self._names)
        return self

    def __exit__(self, *_: object) -> None:
        self._arm.disconnect()
        leave_world(self._world)

    def failures(self) -> Iterator[str]:
        """Move all joints, then all without contacts, then those that still fail alone. Yield what fails."""
        everything = np.arange(len(self._names))
        for part in GOALS:
            missed = self._miss(part, everything)
            if (missed <= TOLERANCE).all():
                continue
            free = self._miss(part, everything, contacts=False)
            self.touching |= {self._names[place] for place in np.flatnonzero(missed > TOLERANCE)}
            for place in np.flatnonzero(free > TOLERANCE):
                self.touching.discard(self._names[place])
                yield from self._alone(part, int(place))

    def _alone(self, part: float, place: int) -> Iterator[str]:
        name, goal = self._names[place], self._low[place] + part * self._span[place]
        time_s = SLOW_MOTION_S if self._group.kinds[place] == "velocity" else MOTION_S
        missed = self._miss(part, np.array([place]), contacts=False, time_s=time_s)[place]
        if missed <= TOLERANCE:
            return
        if self._saturated(place, goal):
            self.held.add(name)
            return
        yield f"{name} ({self._group.kinds[place]} drive) does not reach {part:.0%} of its range"

    def _miss(
        self,
        part: float,
        places: npt.NDArray[np.int64],
        *,
        contacts: bool = True,
        time_s: float = MOTION_S,
    ) -> FloatArray:
        """Return by which fractions of their ranges joints miss a goal from the start, shape (N,).

        Args:
            part: goal, as a fraction of the range; places: joints that move there, the others stay.
            contacts: whether bodies touch each other; time_s: of the motion.
        """
        arm, world = self._arm, self._world
        moved = np.zeros(len(self._names), np.bool_)
        moved[places] = True
        with world.lock, _contacts(self.model, enabled=contacts):
            world.reset()
            arm.enable()
            start = arm.read().position_rad
            goal = np.where(moved, self._low + part * self._span, start)
            arm.write(goal)
            steps = max(1, round(LOOK_S / world.physics.timestep_s))
            for _ in range(int(time_s / (steps * world.physics.timestep_s))):
                world.advance(steps)
                reading = arm.read()
                error = np.abs(reading.position_rad - goal)
                arrives = error + 0.1 * np.abs(reading.velocity_rad_s) < TOLERANCE * self._span
                if arrives[moved].all():
                    break
                if time.monotonic() > self._ends_s:
                    raise TooLongError(f"it was not driven within {TRIAL_S:g} s of computing time")
        return np.asarray(error / self._span)

    def _saturated(self, place: int, goal: float) -> bool:
        """Whether the drives of a joint push towards its goal as hard as they can, measured."""
        way = goal - self._arm.read().position_rad[place]
        force, limit = self._group.torque[place], self._group.force_limit[place]
        return bool(np.isfinite(limit) and force * np.sign(way) >= SATURATED * limit)


@contextlib.contextmanager
def _contacts(model: mujoco.MjModel, *, enabled: bool) -> Iterator[None]:
    before = model.opt.disableflags
    if not enabled:
        model.opt.disableflags = before | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    try:
        yield
    finally:
        model.opt.disableflags = before
