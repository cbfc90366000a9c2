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


def test_a_fork_shows_a_command_line_of_its_own():
    program = """
import os, sys
from joshua.ipc.process_attributes import set_command_line
if os.fork() == 0:
    set_command_line("short")
    print(open("/proc/self/cmdline").read().rstrip(chr(0)), flush=True)
    set_command_line("too long " * 1000)
    print(len(open("/proc/self/cmdline").read().rstrip(chr(0))), flush=True)
    os._exit(0)
os.wait()
line = open("/proc/self/cmdline").read()
print("set_command_line" in line, len(line) - 1)
"""
    shown, length, kept, length_before = run(program)
    assert (shown, length, kept) == ("short", length_before, "True")


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
        while True:  # a signal just before one long sleep would not end it
            time.sleep(0.05)
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


def test_a_priority_needs_the_grant_of_the_system():
    program = """
import os, resource
from joshua.ipc.process_attributes import lock_memory, prefer_this_process
for which in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(which, (0, resource.getrlimit(which)[1]))
print(repr(prefer_this_process()), os.sched_getscheduler(0), os.getpriority(0, 0), lock_memory())
"""
    assert run(program) == ["''", "0", "0", "False"]


@pytest.mark.parametrize(
    ("limits", "granted", "policy", "nice"),
    [
        ({"RTPRIO": 1, "NICE": 40}, "SCHED_RR 1", 2, 0),
        ({"RTPRIO": 0, "NICE": 25}, "nice -5", 0, -5),
        ({"RTPRIO": 0, "NICE": 40}, "nice -10", 0, -10),
    ],
)
def test_a_granted_priority_counts_for_every_thread_that_does_not_stand_lower(limits, granted, policy, nice):
    program = f"""
import os, resource, threading
from joshua.ipc.process_attributes import prefer_this_process
limits = {{getattr(resource, "RLIMIT_" + name): value for name, value in {limits!r}.items()}}
real = resource.getrlimit
resource.getrlimit = lambda which: (limits[which], limits[which]) if which in limits else real(which)
end = threading.Event()
thread, lower = (threading.Thread(target=end.wait) for _ in range(2))
thread.start()
lower.start()
os.setpriority(os.PRIO_PROCESS, lower.native_id, 5)
print(prefer_this_process() or "refused", sep="")
for number in (threading.get_native_id(), thread.native_id, lower.native_id):
    print(os.sched_getscheduler(number), os.getpriority(os.PRIO_PROCESS, number))
end.set()
"""
    shown = " ".join(run(program))
    if shown.startswith("refused"):
        pytest.skip("this user may not raise a priority")
    assert shown == f"{granted} " + " ".join([f"{policy} {nice}"] * 2 + ["0 5"])
