"""The simulator node: runs the physics, shows it, and publishes the model's joints."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api import ConfigurationError, DeviceError, NodeContext, Simulator
from joshua.api.nodes import MessagePublisher, TopicSpec
from joshua.features import EpisodeError
from joshua.messages.make import joint_state
from joshua.tools import TargetError

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.clock import ClockPublisher
from joshua_mujoco_sim.controls import Controls
from joshua_mujoco_sim.coupling import CouplingServer
from joshua_mujoco_sim.episodes import EpisodeMaker
from joshua_mujoco_sim.following import Commands, Mirror
from joshua_mujoco_sim.opengl import RenderingError
from joshua_mujoco_sim.render_files import RenderFile
from joshua_mujoco_sim.replay import Replay
from joshua_mujoco_sim.settings import SimulationSettings
from joshua_mujoco_sim.settings_parts import DatasetSettings
from joshua_mujoco_sim.trajectories.reading import read_trajectories
from joshua_mujoco_sim.window import SHOW_RATE_HZ, Window, WindowError
from joshua_mujoco_sim.world import World, leave_world, shared_world

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Polling period of the simulation state.
WATCH_PERIOD_S = 0.5

#: Period of placing samples of a recording.
REPLAY_PERIOD_S = 1 / 60


class SimulatorNode(Simulator):
    """Runs the physics of a file while the node exists.

    It publishes the joints of all actuators on ``~/joint_states``. INTERACTIVE shows the model in a window
    and follows positions on ``~/joint_commands``; PASSIVE replays a recording and then ends the run; MIRROR
    follows topics of a robot; both show a window if there is a display. It publishes its time on ``/clock``,
    but for MIRROR, since the robot may be simulated, too. Its verbs are those of ``Controls``.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings: SimulationSettings | None = None
        self._world: World | None = None
        self._group: ActuatorGroup | None = None
        self._publisher: MessagePublisher | None = None
        self._mirror: Mirror | None = None
        self._replay: Replay | None = None
        self._replayed_s = 0.0
        self._window: Window | None = None
        self._commands: Commands | None = None
        self._clock: ClockPublisher | None = None
        self._coupling: CouplingServer | None = None
        self._files: list[RenderFile] = []
        self._maker: EpisodeMaker | None = None
        self._reported = 0

    def configure(self) -> None:
        """Load the model and declare the topics. Raises DeviceError, ConfigurationError for a wrong file."""
        spec = self.context.spec
        settings = SimulationSettings.model_validate(spec.settings)
        world = shared_world(settings.world())
        self._settings, self._world = settings, world
        with world.lock:
            self._group = world.physics.group(())
        self._publisher = self.context.publisher(
            TopicSpec(name="~/joint_states", type_name=JOINT_STATE, rate_hz=settings.joint_state_rate_hz)
        )
        self._clock = ClockPublisher(world, self.context, publishes=settings.mode != "MIRROR")
        if path := self.facts.physics_socket:
            self._coupling = CouplingServer(world, Path(path), self.context.log)
        try:
            self._files = [RenderFile(world, render) for render in settings.renders]
        except (RenderingError, OSError) as error:
            raise DeviceError(str(error)) from error
        if settings.generate is not None:
            self._maker = self._make_episodes(world, settings, settings.generate)
        self._open_renderers(world)
        if settings.mode == "MIRROR":
            self._mirror = Mirror(world, settings.mirror_topic_mappings, self.context)
            self._mirror.subscribe()
            self._window = self._window_if_possible(world)
        elif settings.mode == "INTERACTIVE":
            self._commands = Commands(world, self.context)
            self._commands.subscribe()
            self._window = self._open_window(world)
        elif settings.mode == "PASSIVE":
            self._replay = self._read_recording(world, settings)
            self._window = self._window_if_possible(world)

    def verb_providers(self) -> tuple[object, ...]:
        """Return the verbs of the node, of the time controls and of the demonstrator, if any."""
        shown = self._world.demonstrator if self._world is not None else None
        return (self, Controls(lambda: self._running()[0]), *filter(None, (shown,)))

    def activate(self) -> None:
        """Let time run."""
        world, settings = self._running()
        if self._replay is not None:
            self._replayed_s = time.monotonic()
            self.context.create_timer(REPLAY_PERIOD_S, self._advance_replay, name="replay")
        else:
            with world.lock:
                if self._files:  # all devices have joined: the same start, in any order
                    world.physics.reset(0)
                for file in self._files:
                    file.begin()
                if self._maker is not None:
                    self._maker.begin()
            world.start()
        if self._window is not None:
            self.context.create_timer(1 / SHOW_RATE_HZ, self._show, name="window")
        self.context.create_timer(1 / settings.joint_state_rate_hz, self._publish, name="joint states")
        self.context.create_timer(WATCH_PERIOD_S, self._watch, name="watch")

    def cleanup(self) -> None:
        """Leave the physics; it ends unless devices of this process still use it."""
        if self._window is not None:
            self._window.close()
        for part in (self._clock, self._commands, self._coupling):
            if part is not None:
                part.close()
        if self._replay is not None:
            self.context.log.info("%s", self._replay.report())
        if self._mirror is not None:
            self.context.log.info("%s", self._mirror.report())
            self._mirror.close()
        world, self._world = self._world, None
        if world is not None:
            world.pause()
            for file in self._files:
                with world.quiet():
                    file.close()
                if file.error:
                    self.context.log.error("%s", file.error)
                self.context.log.info("wrote %d pictures to %s", file.count, file.output)
            self._files = []
            if self._maker is not None:
                with world.quiet():
                    self._maker.close()
                self.context.log.info("%s", self._maker.report())
            if self._replay is None:
                self.context.log.info("real-time factor %.3f", world.real_time_factor)
            leave_world(world)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the test rows: whether the simulation kept its pace and did not diverge."""
        if self._world is None:
            return []
        world, settings = self._running()
        factor, wanted = world.real_time_factor, settings.real_time_factor
        rows = [("no divergence", not world.divergence_count, f"{world.divergence_count} times")]
        if wanted > 0:
            rows.append(("real-time factor", abs(factor - wanted) <= 0.02 * wanted, f"{factor:.3f}"))
        return rows

    def _open_window(self, world: World) -> Window:
        try:
            return Window(world)
        except WindowError as error:
            raise DeviceError(str(error)) from error

    def _window_if_possible(self, world: World) -> Window | None:
        try:
            return Window(world)
        except WindowError as error:
            self.context.log.warning("runs without a window: %s", error)
            return None

    def _read_recording(self, world: World, settings: SimulationSettings) -> Replay:
        if not settings.trajectory_path:
            raise ConfigurationError("PASSIVE replays a recording: name it in simulation.trajectory_path")
        recordings = read_trajectories(
            Path(settings.trajectory_path), settings.episodes, settings.trajectory_unit
        )
        return Replay(world.physics, recordings, settings.replay_speed)

    def _open_renderers(self, world: World) -> None:
        parts: list[RenderFile | EpisodeMaker] = [*self._files]
        if self._maker is not None:
            parts.append(self._maker)
        for part in parts:
            world.start()
            world.call(part.open)
            if part.error:
                raise DeviceError(part.error)

    def _make_episodes(
        self, world: World, settings: SimulationSettings, made: DatasetSettings
    ) -> EpisodeMaker:
        try:
            path, unit = settings.trajectory_path, settings.trajectory_unit
            recordings = read_trajectories(Path(path), unit=unit) if path else []
            with world.lock:
                return EpisodeMaker(world, made, recordings, self.context.log)
        except (EpisodeError, TargetError) as error:
            raise DeviceError(str(error)) from error

    def _advance_replay(self) -> None:
        world, _ = self._running()
        replay = self._replay
        assert replay is not None
        now_s = time.monotonic()
        known = len(replay.breaches)
        with world.lock:
            replay.advance(now_s - self._replayed_s)
        self._replayed_s = now_s
        for breach in replay.breaches[known:]:
            self.context.log.warning("%s", breach.text)
        if replay.done:
            self.context.end_run(replay.report())

    def _show(self) -> None:
        window = self._window
        assert window is not None
        if window.is_open:
            window.show()
        else:
            self.context.end_run("the window was closed")

    def _publish(self) -> None:
        world, _ = self._running()
        assert self._group is not None
        assert self._publisher is not None
        with world.lock:
            position, velocity, force = (
                self._group.position_rad,
                self._group.velocity_rad_s,
                self._group.torque,
            )
        self._publisher.publish(
            joint_state(
                list(self._group.joints),
                position,
                velocity,
                np.nan_to_num(force),
                frame_id=self.context.spec.frame_id,
                at_ns=self.context.now_ns(),
            )
        )

    def _watch(self) -> None:
        world, _ = self._running()
        with world.lock:
            count, texts = world.divergence_count, world.divergences[self._reported :]
        more = count - self._reported - 1
        if more >= 0:
            text = texts[0] if texts else f"the simulation diverged, {count} times by now"
            again = f", and {more} more times since" if more else ""
            self.context.log.error("%s; the model was reset to its start%s", text, again)
        self._reported = count
        broken = [file.error for file in self._files if file.error]
        if self._maker is not None:
            broken += filter(None, [self._maker.error])
            self.context.progress("episodes", self._maker.written, self._maker.wanted)
            if self._maker.done:
                self.context.end_run(self._maker.report())
        if world.failure or broken:
            self.context.fail(world.failure or broken[0])

    def _running(self) -> tuple[World, Any]:
        if self._world is None or self._settings is None:
            raise RuntimeError(f"{self.context.spec.full_name}: activate came before configure")
        return self._world, self._settings
