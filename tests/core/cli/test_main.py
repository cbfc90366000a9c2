"""The program as a shell starts it: closed streams, odd bytes, options without a file."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from joshua.cli.commands.plan import node_lines
from joshua.cli.main import main
from joshua.cli.presets import FOLDER
from joshua.cli.run import interruptible
from joshua.plan import NodeKind, NodeSpec

PROGRAM = "import sys; from joshua.cli.main import program; program()"
PRESET = FOLDER / "test_mock_hardware.pbtxt"
STRICT = {**os.environ, "PYTHONIOENCODING": "utf-8:strict"}


def joshua(*words: str, **options: Any) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", PROGRAM, *words]
    return subprocess.run(command, env=STRICT, capture_output=True, timeout=60, **options)


def test_a_path_that_is_no_text_is_shown_all_the_same(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/b\xff.pbtxt")
    shutil.copy(PRESET, path)
    checked = joshua("--config", path, "--validate-only")
    assert checked.returncode == 0, checked.stderr
    assert checked.stdout.endswith(b"b\\udcff.pbtxt: valid\n")


def test_closed_streams_are_no_reason_to_fail(tmp_path: Path) -> None:
    script = f'exec {sys.executable} -c "{PROGRAM}" --config {PRESET} --validate-only <&- >&-'
    checked = subprocess.run(["sh", "-c", script], stderr=subprocess.PIPE, timeout=60)
    assert (checked.returncode, checked.stderr) == (0, b"")


@pytest.mark.parametrize(
    "words",
    [
        ("explain", "\udcff"),
        ("--config", str(PRESET), "--set", 'general.mode="\udcff"', "--validate-only"),
        ("topic", "pub", "/x", "\udcff"),
    ],
)
def test_a_word_that_is_no_text_is_refused_like_any_other(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert capsys.readouterr().err


def test_options_without_a_file_say_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--validate-only"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("joshua: error: no file given: add --config PATH")
    assert main(["--config", ""]) == 2
    assert "The path of the configuration file is empty" in capsys.readouterr().err
    assert main([]) == 2
    assert capsys.readouterr().out.startswith("usage:")


def test_before_the_start_a_signal_is_like_ctrl_c_and_comes_once() -> None:
    former = signal.getsignal(signal.SIGTERM)
    tidied = []

    @interruptible()
    def work() -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # `timeout` sends it twice
            tidied.append("all")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert tidied == ["all"]
    assert signal.getsignal(signal.SIGTERM) is former


def test_a_signal_after_the_run_does_not_cut_off_its_last_lines() -> None:
    written = []
    with interruptible() as interrupts:
        interrupts.ignored = True
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(os.getpid(), number)
        written.append("the last line")
    assert written == ["the last line"]


def test_nothing_is_imported_before_ctrl_c_is_an_orderly_end() -> None:
    code = "import sys, joshua.cli.main; print('argparse' in sys.modules, 'joshua.cli.parser' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60).stdout
    assert shown == "False False\n"


def test_a_plan_that_is_shown_hides_the_password_of_an_address() -> None:
    settings = {"source": "http://me:pw@cam:80/a@b", "port": "/dev/ttyACM0"}
    camera = NodeSpec(
        name="cam", kind=NodeKind.SENSOR, behaviour="b:B", implementation="c:C", settings=settings
    )
    assert node_lines(camera)[2:] == [
        "  setting    source = http://***@cam:80/a@b",
        "  setting    port = /dev/ttyACM0",
    ]
