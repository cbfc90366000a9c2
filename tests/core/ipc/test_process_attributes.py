"""Attributes that only the kernel can set."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")


def run(program):
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    return result.stdout.split()


def test_the_title_is_the_name_that_the_system_shows():
    program = """
from joshua.ipc.process_attributes import set_title
assert set_title("a_rather_long_name_of_a_node")
print(open("/proc/self/comm").read())
"""
    assert run(program) == ["a_rather_long_n"]


def test_a_child_gets_the_death_signal_of_its_parent():
    program = """
import os, signal, time
from joshua.ipc.process_attributes import set_parent_death_signal
reading, writing = os.pipe()
ready_reading, ready_writing = os.pipe()
if os.fork() == 0:
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, lambda *_: (os.write(writing, b"asked"), os._exit(0)))
        assert set_parent_death_signal(signal.SIGTERM)
        os.write(ready_writing, b"r")
        time.sleep(60)
    os.read(ready_reading, 1)
    os._exit(0)
print(os.read(reading, 100).decode())
"""
    assert run(program) == ["asked"]


def test_a_subreaper_inherits_orphans():
    program = """
import os, time
from joshua.ipc.process_attributes import set_child_subreaper
assert set_child_subreaper(True)
if os.fork() == 0:
    if os.fork() == 0:
        time.sleep(0.05)
        os._exit(7)
    os._exit(3)
print(sorted(os.waitstatus_to_exitcode(os.wait()[1]) for _ in range(2)))
"""
    assert "".join(run(program)) == "[3,7]"


def test_a_real_time_priority_needs_the_grant_of_the_system():
    program = """
import os, resource
from joshua.ipc.process_attributes import use_realtime_priority
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, resource.getrlimit(resource.RLIMIT_RTPRIO)[1]))
print(use_realtime_priority(), os.sched_getscheduler(0) == os.SCHED_OTHER)
"""
    assert run(program) == ["False", "True"]


def test_a_granted_real_time_priority_is_taken():
    program = """
import os, resource
from joshua.ipc.process_attributes import use_realtime_priority
try:
    resource.setrlimit(resource.RLIMIT_RTPRIO, (1, 1))
    os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
except (OSError, ValueError):
    print("refused")
else:
    print(use_realtime_priority(), os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR)
"""
    shown = run(program)
    if shown == ["refused"]:
        pytest.skip("this system grants no real-time priority")
    assert shown == ["True", "True"]
