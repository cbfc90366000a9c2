"""A recording of two emulated arms and two cameras: drops, alignment, cores and memory of the recorder.

It is the preset data_store_record with --emulate: 6 + 6 joints at 50 Hz, two 640 x 480 cameras and frames at
30 Hz. The emulators run on the same machine and are not counted. Ends with 1 where a figure is missed.
Run: python tests/benchmarks/recording_run.py [SECONDS]
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from joshua.testing.domain import reserved_domain
from joshua_dataset.reader import Dataset

sys.path.append(str(Path(__file__).parents[1] / "support"))

from processes import descendants_of, title_of

SECONDS = 60.0
PRESET = Path(__file__).parents[2] / "configs/data_store_record.pbtxt"
FPS = 30
MOST_CORES, MOST_GROWTH_MB = 1.0, 20.0
TICKS = os.sysconf("SC_CLK_TCK")


def used_s(process_id: int) -> float:
    """Processor time of a process, all threads."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def memory_mb(process_id: int) -> float:
    """Memory of its own that a process has in use; pages shared with the fork server are not counted."""
    text = Path(f"/proc/{process_id}/smaps_rollup").read_text()
    return sum(float(value) for value in re.findall(r"^Private_\w+: +(\d+)", text, re.MULTILINE)) / 1024


def watched(run: subprocess.Popen[str], folder: Path, seconds: float) -> tuple[float, list[float]]:
    """Cores that the recorder takes, and its memory, from the second second of the episode to its end."""
    end_s = time.monotonic() + 60
    while not (folder / ".joshua/open").exists():
        assert time.monotonic() < end_s, "the episode did not start"
        time.sleep(0.1)
    (recorder,) = [pid for pid in descendants_of(run.pid) if "data_store" in title_of(pid)]
    time.sleep(2)
    began_s, before_s, memory = time.monotonic(), used_s(recorder), []
    while time.monotonic() < began_s + seconds - 4:
        time.sleep(1)
        try:
            memory.append(memory_mb(recorder))
        except FileNotFoundError:  # the episode ended early, and with it the run
            return 0.0, memory
    return (used_s(recorder) - before_s) / (time.monotonic() - began_s), memory


def main() -> int:
    """Record, and print the figures."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    with tempfile.TemporaryDirectory() as name, reserved_domain() as domain:
        folder = Path(name) / "set"
        values = {"local_path": str(folder), "auto_start": "true", "num_episodes": "1"}
        values["episode_duration_s"] = str(seconds)
        words = [word for key, value in values.items() for word in ("--set", f"ai.data_store.{key}={value}")]
        command = [sys.executable, "-m", "joshua", "--config", str(PRESET), "--emulate", *words]
        environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "JOSHUA_RUN_DIR": str(Path(name) / "runs")}
        with (Path(name) / "log").open("w+") as log:
            run = subprocess.Popen(
                command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, text=True, env=environment
            )
            try:
                cores, memory = watched(run, folder, seconds)
                run.wait(60)
            except subprocess.TimeoutExpired:
                print("the run did not end")
            finally:
                if run.poll() is None:
                    run.terminate()
                    run.wait(30)
            log.seek(0)
            said = log.read()
            if run.returncode:
                print(said)
                return 1
        episode, *others = Dataset.read(folder).episode_list()
        columns = Dataset.read(folder).columns(episode)
    if others or episode.length < 0.95 * seconds * FPS:
        print(f"the episode ended after {episode.length / FPS:.0f} s:\n{said}")
        return 1
    distance_ms = np.abs(columns["acquisition_ns"] - columns["stamp_ns"][:, None]) / 1e6
    p99_ms = float(np.quantile(distance_ms, 0.99))
    tenth = max(1, len(memory) // 10)
    growth_mb = float(np.median(memory[-tenth:]) - np.median(memory[tenth : 2 * tenth]))
    dropped = episode.counts["dropped"]
    half_ms = 500 / FPS
    print(f"{seconds:.0f} s of two arms and two cameras, load {os.getloadavg()[0]:.1f}")
    missed = []
    for label, figure, limit, text in (
        ("frames dropped", dropped, 0, f"{dropped} of {dropped + episode.length}"),
        ("recorder, cores", cores, MOST_CORES, f"{cores:.2f}"),
        ("memory growth, MB", growth_mb, MOST_GROWTH_MB, f"{growth_mb:.1f} of {np.median(memory):.0f}"),
        ("alignment p99, ms", p99_ms, half_ms, f"{p99_ms:.1f} (largest {distance_ms.max():.1f})"),
    ):
        verdict = "reached" if figure <= limit else "missed"
        missed += [label] if verdict == "missed" else []
        print(f"  {label:<20} {text:<24} at most {limit:g}: {verdict}")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
