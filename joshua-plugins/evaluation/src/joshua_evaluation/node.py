"""Node of an evaluation: plays episodes on its own thread, writes figures and report, ends the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from joshua.api import NodeContext
from joshua_jobs import executor as jobs
from joshua_jobs.choice import opened
from joshua_training.clusters import on_cluster
from joshua_training.run_folder import RunError
from joshua_training.trainer import RunNode

from joshua_evaluation import report
from joshua_evaluation.bouts import Bout, played
from joshua_evaluation.checkpoints import CheckpointError
from joshua_evaluation.episodes import VIDEO_SIZE, Arena, Player, Stopped, play
from joshua_evaluation.metrics import BUILT_IN, Episode, Metric, load_metric
from joshua_evaluation.results import Intervals, Judged, as_csv, as_json, as_text
from joshua_evaluation.robot import Robot
from joshua_evaluation.settings import DEFAULT_SEED, ON_ROBOT, Candidate, EvaluationSettings

REPORT, TABLE, RESULTS = "report.html", "episodes.csv", "results.json"


class Evaluation(RunNode):
    """Evaluates checkpoints in simulated episodes, and ends the run when all are played."""

    THREAD = "evaluation"
    CONTENT = "evaluation"
    LATE = "files are missing"

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = EvaluationSettings.model_validate(context.spec.settings)
        self._metrics: tuple[Metric, ...] = ()
        self._about: dict[str, Any] = {}
        self._seed = DEFAULT_SEED
        self._robot: Robot | None = None
        self._executor: jobs.Executor | None = None
        self._failure: jobs.JobError | None = None

    def configure(self) -> None:
        """Load the metrics and create the run's folder."""
        settings, chosen = self._settings, self.facts.environment
        if settings.is_on_robot:
            self._watch_robot()
            return
        if chosen is None:
            raise RunError("the plan has no environment: set ai.training.environment_id")
        if not settings.candidates:
            raise RunError("there is no checkpoint to evaluate: correct model_checkpoint")
        names = settings.metrics or tuple(BUILT_IN)
        self._metrics = tuple(map(load_metric, names))
        seed = settings.seed if settings.seed is not None else chosen.seed
        self._seed = DEFAULT_SEED if seed is None else seed
        drawn = settings.compute.seed
        self._about = {
            "environment": chosen.environment_id,
            "reward_function": chosen.reward_function,
            "randomise": settings.randomise,
            "noise_seed": self._seed if drawn is None else drawn,
            "wanted": settings.num_episodes,
        }
        hidden = {"output_folder", "resume_run", "environment", "environment_id", "tracking"}
        hidden |= {"candidates", "chosen"}
        facts = {
            **self._about,
            "kind": "evaluation",
            "seed": self._seed,
            "settings": {
                **settings.model_dump(mode="json", exclude=hidden),
                **{item.field.rpartition(".")[2]: item.given for item in settings.candidates},
            },
        }
        self.begin(settings.output_folder, f"eval-{chosen.environment_id.rpartition('/')[2]}", facts)
        self._about |= {key: self.folder.facts()[key] for key in ("versions", "started")}

    def _watch_robot(self) -> None:
        """Subscribe to the episodes of the model, to the joints of its arms and to a camera."""
        settings = self._settings
        self._metrics = tuple(map(load_metric, settings.metrics or ON_ROBOT))
        self._seed = DEFAULT_SEED if settings.seed is None else settings.seed
        self._robot = Robot(self.context)
        self._about = {"environment": "the robot", "reward_function": "", "wanted": settings.num_episodes}
        if len(settings.candidates) > 1:
            self._about["order"] = blind_order(settings.num_episodes, self._seed)
        hidden = {"output_folder", "resume_run", "candidates", "chosen"}
        facts = {
            **self._about,
            "kind": "evaluation",
            "settings": {
                **settings.model_dump(mode="json", exclude=hidden),
                **{item.field.rpartition(".")[2]: item.given for item in settings.candidates},
            },
        }
        self.begin(settings.output_folder, "eval-robot", facts)
        self._about |= {key: self.folder.facts()[key] for key in ("versions", "started")}

    def _marked(self, robot: Robot) -> list[Judged]:
        """Wait until all episodes are marked; fewer if the run is stopped.

        Two checkpoints play each start in an order drawn by chance, which nobody is told.
        """
        candidates, order = self._settings.candidates, self._about.get("order") or [0]
        if len(candidates) > 1:
            for item in candidates[::-1]:  # both can be loaded, before the first episode
                robot.use(item.path)
        self.context.log.info(
            "the model waits: begin an episode with `joshua episode`, key b, and mark it with s or f"
        )
        total = self._settings.num_episodes * len(candidates)
        counts = range(1, total + 1) if len(candidates) > 1 else (total,)
        for count in counts:
            if len(candidates) > 1:
                self.context.show(f"prepares episode {count}")
                robot.use(candidates[order[count - 1]].path)
            if not robot.wait(count, partial(self._tell, robot), goal=total):
                break
        marked = robot.marks.episodes
        judged = [Judged(item.given, self._metrics) for item in candidates]
        for start in range(len(marked) // len(candidates)):
            for number in range(start * len(candidates), (start + 1) * len(candidates)):
                episode = replace(marked[number], seed=start + 1)
                self._add(judged[order[number] if len(candidates) > 1 else 0], episode)
        return judged

    def _add(self, judged: Judged, episode: Episode) -> None:
        for said in judged.add(episode):
            self.warn(f"{said}; the other figures go on without it")

    def _tell(self, robot: Robot, state: str) -> None:
        done = [bool(episode.success) for episode in robot.marks.episodes]
        start = f" of start {len(done) // 2 + 1}" if len(self._settings.candidates) > 1 else ""
        self.context.show(f"{state}{start}; {sum(done)} of {len(done)} succeeded{robot.stopped}")

    def work(self) -> None:
        """Play the episodes, and write figures and report."""
        robot = self._robot
        judged = self._judged_somewhere() if robot is None else self._marked(robot)
        if not judged or not judged[0].episodes:
            if self._failure is not None:
                raise RunError(str(self._failure)) from self._failure
            return
        failed = {name: said for one in judged for name, said in one.failed.items()}
        for one in judged:
            one.leave_out(failed)
        self._about["failed"] = failed
        wanted = self._settings.num_episodes * len(self._settings.candidates)
        count = sum(len(one.episodes) for one in judged)
        complete = count == wanted
        clips, note = self._shown(judged, robot) if robot else self._clips(judged) if complete else ([], "")
        if self.context.stopping and complete:
            note = "The run was stopped before all videos were made."
        self._write(judged, clips, note, complete)
        if self._failure is not None:
            raise RunError(
                f"{self._failure}. {count} of {wanted} episodes were played; their figures are in "
                f"{self.folder.path / REPORT}"
            ) from self._failure
        if missing := [said for name, said in failed.items() if name in self._settings.metrics]:
            raise RunError(f"{'; '.join(missing)}. The other figures are in {self.folder.path / REPORT}")
        if complete:
            self.end_run(self._summary(judged))

    def _judged_somewhere(self) -> list[Judged]:
        """Play all episodes here, or on the cluster of the file; fewer if that fails. Raises RunError."""
        settings = self._settings
        if not settings.cluster:
            return self._judged()
        try:
            with (
                on_cluster(),
                opened(("ray", settings.cluster), settings.cluster_workers) as self._executor,
            ):
                workers = self._executor.workers
                self.context.log.info("%d workers of the cluster %s play", workers, settings.cluster)
                judged = self._judged()
                self._about["workers_lost"] = self._executor.lost
        finally:
            self._executor = None
        if self._about["workers_lost"]:
            self.warn(f"workers lost: {self._about['workers_lost']}; their episodes were played again")
        return judged

    def _shown(self, judged: Sequence[Judged], robot: Robot) -> tuple[list[report.Clip], str]:
        """Return the films of the best and worst episodes on the robot; and why there are none, else ""."""
        if not self._settings.videos:
            return [], ""
        if not robot.filmed:
            return [], "No videos: no node of the file publishes pictures."
        order, count = self._about.get("order") or [0] * len(robot.marks.films), len(judged)
        clips = []
        for which, one in enumerate(judged):
            films = [film for film, by in zip(robot.marks.films, order, strict=False) if by == which]
            for label, index in chosen(one.order, self._settings.videos):
                if mp4 := films[index].develop():
                    episode = one.episodes[index]
                    start = f"start {episode.seed}" if count > 1 else f"episode {episode.seed}"
                    clips.append(report.Clip(mp4, f"{label} of {one.name}: {start}, {episode.outcome}"))
        return clips, "" if clips else "No videos: the camera published no picture during an episode."

    def _judged(self) -> list[Judged]:
        """Play all episodes with each checkpoint; fewer if the run is stopped, or the cluster fails."""
        settings, done = self._settings, 0
        total = settings.num_episodes * len(settings.candidates)
        found: list[Judged] = []
        for candidate in settings.candidates[1:]:  # before hours of episodes with the first one
            self._try_out(self._bout(candidate))
        for candidate in settings.candidates:
            bout = self._bout(candidate)
            player = bout.player()
            arena = bout.arena(player.options)
            try:
                player.load(arena)
                judged = Judged(candidate.given, self._measurable(arena))
                found.append(judged)
                self.context.log.info("evaluating %s", candidate.path)
                for episode in self._played(bout, arena, player):
                    self._add(judged, episode)
                    done += 1
                    self.context.progress("evaluation", float(done), float(total), unit="episodes")
                    lost = f", {self._executor.lost} workers lost" if self._executor is not None else ""
                    self.context.show(f"{' '.join(judged.headline)}{lost}")
            except Stopped:
                break
            except jobs.JobError as error:
                self._failure = error
                break
            finally:
                player.close()
                arena.close()
        return found

    def _try_out(self, bout: Bout) -> None:
        """Load a checkpoint once, which raises its error."""
        player = bout.player()
        arena = bout.arena(player.options)
        try:
            player.load(arena)
        finally:
            player.close()
            arena.close()

    def _measurable(self, arena: Arena) -> tuple[Metric, ...]:
        """Return the metrics, without default ones for which the environment lacks something."""
        lacking = [m for m in self._metrics if m.needs and m.needs not in arena.provided]
        if lacking and self._settings.metrics:
            name, needs = lacking[0].name, lacking[0].needs
            raise CheckpointError(
                f"The metric {name} requires {needs}, which {self._about['environment']} does not provide",
                f"Remove {name} from metrics",
            )
        return tuple(metric for metric in self._metrics if metric not in lacking)

    def _played(self, bout: Bout, arena: Arena, player: Player) -> Iterator[Episode]:
        """Play the episodes in order: here, or in the workers of a cluster."""
        seeds = range(self._seed, self._seed + self._settings.num_episodes)
        if self._executor is None:
            for seed in seeds:
                yield play(arena, player, seed, lambda: self.context.stopping)
            return
        items = ((bout, seed) for seed in seeds)
        try:
            yield from self._executor.in_order(played, items, lambda: self.context.stopping)
        except jobs.Stopped as error:
            raise Stopped from error

    def _bout(self, candidate: Candidate) -> Bout:
        settings, chosen = self._settings, self.facts.environment
        assert chosen is not None
        return Bout(
            candidate,
            chosen.make,
            chosen.environment_id,
            chosen.reward_function,
            randomise=settings.randomise,
            task=settings.task,
            strategy=settings.strategy,
            steps_per_chunk=settings.steps_per_chunk,
            delay=settings.inference_delay,
            noise_seed=self._about["noise_seed"],
        )

    def _clips(self, judged: Sequence[Judged]) -> tuple[list[report.Clip], str]:
        """Return videos of the best and worst episodes, played again; and why there are none, else ""."""
        if not self._settings.videos:
            return [], ""
        clips: list[report.Clip] = []
        try:
            for candidate, one in zip(self._settings.candidates, judged, strict=True):
                clips += self._filmed(candidate, one)
        except Stopped:
            pass
        except Exception as error:  # noqa: BLE001 (OpenGL, codecs: figures are worth more than videos)
            self.warn(f"the report has no videos: {error}")
            return clips, f"No videos: {error}"
        return clips, ""

    def _filmed(self, candidate: Candidate, judged: Judged) -> list[report.Clip]:
        from joshua_evaluation.videos import as_mp4

        bout = self._bout(candidate)
        player = bout.player()
        plain = bout.arena(player.options)
        camera = self._settings.camera or plain.camera
        plain.close()
        shown = player.options.get("cameras", ())
        size = {"width": VIDEO_SIZE[0], "height": VIDEO_SIZE[1]}
        options = {**size, **player.options, "observation_mode": "both"}
        options["cameras"] = tuple(dict.fromkeys((*shown, camera)))
        arena = bout.arena(options)
        clips = []
        try:
            player.load(arena)
            for label, index in chosen(judged.order, self._settings.videos):
                pictures: list[Any] = []
                episode = judged.episodes[index]
                again = play(
                    arena,
                    player,
                    episode.seed,
                    lambda: self.context.stopping,
                    lambda seen, into=pictures: into.append(seen[camera][0].copy()),  # type: ignore[misc]
                )
                caption = _caption(label, judged, index)
                if abs(again.rewards.sum() - episode.rewards.sum()) > 1e-6:
                    caption += "; its replay differed"
                clips.append(report.Clip(as_mp4(pictures, 1 / arena.period_s), caption))
        finally:
            player.close()
            arena.close()
        return clips

    def _write(
        self, judged: Sequence[Judged], clips: Sequence[report.Clip], note: str, complete: bool
    ) -> None:
        settings = self._settings
        intervals = Intervals(settings.confidence, settings.bootstrap_samples, self._seed)
        results = as_json(judged, {**self._about, "complete": complete}, intervals)
        folder = self.folder
        try:
            folder.write(TABLE, as_csv(judged, rewarded=self._robot is None).encode())
            folder.write(REPORT, report.page(results, judged, clips, note).encode())
            folder.write(RESULTS, as_text(results))
        except RunError as error:
            raise RunError(f"{error}, and evaluate again; the same seeds give the same episodes") from error
        self.context.log.info("report %s", folder.path / REPORT)

    def _summary(self, judged: Sequence[Judged]) -> str:
        name = judged[0].headline[0]
        values = " against ".join(one.headline[1] for one in judged)
        return f"{len(judged[0].episodes)} episodes: {name} {values}, {self.folder.path / REPORT}"


def blind_order(starts: int, seed: int) -> list[int]:
    """Return which of two checkpoints plays each episode: both play every start, in an order by chance."""
    import numpy as np

    first = np.random.default_rng(seed).integers(0, 2, starts)
    return [int(which) for one in first for which in (one, 1 - one)]


def chosen(order: Sequence[int], count: int) -> list[tuple[str, int]]:
    """Return the labels and indices of the episodes that the report shows, the best first."""
    best = order[:count]
    worst = [index for index in order[-count:] if index not in best] if count else []
    return [("best", index) for index in best] + [("worst", index) for index in worst]


def _caption(label: str, judged: Judged, index: int) -> str:
    episode = judged.episodes[index]
    outcome = f"{episode.outcome}, " if episode.outcome else ""
    return (
        f"{label} of {judged.name}: episode {index}, seed {episode.seed}, {outcome}"
        f"return {episode.rewards.sum():.4g}, {episode.steps} steps"
    )
