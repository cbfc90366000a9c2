"""The fork server: single-threaded, reports ends, ends itself."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time

import pytest
from joshua.ipc.frames import EndOfStreamError
from joshua.supervisor import fork_server

PATIENCE_S = 60.0


def wait_for(server, kind):
    """Waits for an event of a kind; returns it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        select.select([server.fileno()], [], [], end - time.monotonic())
        for event in server.receive():
            if event.event == kind:
                return event
    raise AssertionError(f"no {kind} event")


@pytest.fixture
def server():
    made = fork_server.start(preload=False)
    yield made
    made.close()


@pytest.fixture
def descriptors():
    """Control socket, output and error of a child: here all the same pipe; and its reading end."""
    reading, writing = os.pipe()
    yield (writing, writing, writing), reading
    os.close(reading)
    os.close(writing)


def shell(server, descriptors, script):
    arguments = [sys.executable, "-S", "-c", script]
    return server.ask("execute", descriptors, arguments=arguments, environment=dict(os.environ))


def test_the_server_has_one_thread_after_it_has_loaded_everything():
    server = fork_server.start()
    try:
        event = wait_for(server, "preloaded")
        assert event.text == ""
        assert event.threads == 1
    finally:
        server.close()


def test_the_server_imports_the_modules_of_its_children_once_and_survives_a_broken_one(
    descriptors, tmp_path, monkeypatch
):
    (tmp_path / "shared_by_children.py").write_text(
        f"import os\nopen({str(tmp_path / 'importers')!r}, 'a').write(f'{{os.getpid()}} ')\n"
    )
    (tmp_path / "broken_module.py").write_text("raise RuntimeError('broken')")
    monkeypatch.syspath_prepend(tmp_path)
    server = fork_server.start(preload=False)
    try:
        for _ in range(2):
            server.ask("fork", descriptors[0], title="child", modules=["broken_module", "shared_by_children"])
            wait_for(server, "started")
            wait_for(server, "exited")
        assert (tmp_path / "importers").read_text().split() == [str(server.process_id)]
    finally:
        server.close()


def test_a_single_threaded_caller_is_forked_and_one_with_threads_is_not():
    program = """
import json, sys, threading, time
from joshua.supervisor import fork_server
stop = threading.Event()
if sys.argv[1] == "threads":
    threading.Thread(target=stop.wait).start()
server = fork_server.start(preload=False)
print(json.dumps(server._process is None))
stop.set()
server.close()
"""
    for mode, forked in (("alone", True), ("threads", False)):
        output = subprocess.run(
            [sys.executable, "-W", "error", "-c", program, mode],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
        assert json.loads(output.stdout) is forked
        assert output.stderr == ""


def test_heavy_modules_stay_out_of_the_caller():
    program = """
import sys
from joshua.supervisor import fork_server
fork_server.start(preload=False).close()
print([name for name in ("numpy", "pydantic", "zenoh", "rosbags", "rich") if name in sys.modules])
"""
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert output.stdout.strip() == "[]", output.stderr


@pytest.mark.parametrize(
    ("script", "status"),
    [
        ("raise SystemExit(7)", 7),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", -signal.SIGKILL),
    ],
)
def test_the_end_of_a_child_is_told_with_its_status(server, descriptors, script, status):
    request = shell(server, descriptors[0], script)
    started = wait_for(server, "started")
    assert started.request == request
    exited = wait_for(server, "exited")
    assert exited.process_id == started.process_id
    assert os.waitstatus_to_exitcode(exited.status) == status


def test_a_program_that_cannot_be_run_says_so_on_its_standard_error(server, descriptors):
    server.ask("execute", descriptors[0], arguments=["/nowhere/python"], environment={})
    exited = wait_for(server, "exited")
    assert os.waitstatus_to_exitcode(exited.status) == 70
    assert b"/nowhere/python" in os.read(descriptors[1], 65536)


def test_a_child_has_no_descriptors_but_its_own(server, descriptors):
    script = "import os; os.write(1, str(sorted(map(int, os.listdir('/proc/self/fd')))).encode())"
    shell(server, descriptors[0], script)
    wait_for(server, "exited")
    # The last one is that of the listing itself.
    assert os.read(descriptors[1], 4096) == b"[0, 1, 2, 3, 4]"


def test_closing_kills_children_that_ignore_everything(server, descriptors, monkeypatch):
    monkeypatch.setattr(fork_server, "CLOSE_TIMEOUT_S", 60.0)  # a busy server gets the time for it
    script = """
import os, signal, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
os.write(1, b"x")
time.sleep(99)
"""
    shell(server, descriptors[0], script)
    started = wait_for(server, "started")
    assert os.read(descriptors[1], 1) == b"x"

    server.close()
    server.close()
    with pytest.raises(ProcessLookupError):
        os.kill(started.process_id, 0)


def test_a_dead_server_is_told(server, descriptors):
    os.kill(server.process_id, signal.SIGKILL)
    with pytest.raises(EndOfStreamError):
        wait_for(server, "exited")
    with pytest.raises(EndOfStreamError):
        shell(server, descriptors[0], "pass")


def test_a_server_without_children_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(fork_server, "CLOSE_TIMEOUT_S", 1e6)
    server = fork_server.start()
    os.kill(server.process_id, signal.SIGSTOP)  # as busy as can be
    server.close()
    with pytest.raises(ProcessLookupError):
        os.kill(server.process_id, 0)


def test_ctrl_c_does_not_end_the_server(server, descriptors):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(server.process_id, number)
    shell(server, descriptors[0], "pass")
    wait_for(server, "exited")


def test_many_requests_at_once_are_all_served(server, descriptors):
    for _ in range(20):
        shell(server, descriptors[0], "pass")
    ended = 0
    while ended < 20:
        select.select([server.fileno()], [], [], PATIENCE_S)
        ended += sum(event.event == "exited" for event in server.receive())
