"""Node behaviours that tests run in real child processes.

Why one file: a list of small behaviours, which child processes import by one name.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from joshua.devices.errors import ConfigurationError, DeviceError
from joshua.node.behaviour import NodeBehaviour
from joshua.node.errors import NodeError
from joshua.plan import TopicSpec


class Quiet(NodeBehaviour):
    """Does nothing but turn its loop; notes each step in a file where one is named."""

    def note(self, step: str) -> None:
        path = self.context.spec.settings.get("notes")
        if path:
            with Path(path).open("a") as file:
                file.write(f"{self.context.spec.name} {step}\n")

    def configure(self) -> None:
        self.note("configure")
        if self.context.spec.facts.restarted:
            self.note("restarted")

    def activate(self) -> None:
        self.note("activate")

    def deactivate(self) -> None:
        self.note("deactivate")

    def cleanup(self) -> None:
        self.note("cleanup")


class Ticking(Quiet):
    """Runs a timer at 100 Hz and publishes at 50 Hz on each topic of its block."""

    def configure(self) -> None:
        super().configure()
        self.context.create_timer(0.01, self.tick, name="control")
        self.ticks = 0

    def tick(self) -> None:
        self.ticks += 1
        if self.ticks == 1:
            self.note("ticks")

    def test_results(self) -> list[tuple[str, bool, str]]:
        return [("ticks", self.ticks > 0, str(self.ticks))]


class Talker(Quiet):
    """Publishes strings on its first publisher."""

    def configure(self) -> None:
        super().configure()
        from joshua.messages import message_class

        self.message = message_class("std_msgs/msg/String")
        self.publisher = self.context.publisher(self.context.spec.publishers[0])
        self.context.create_timer(0.02, self.tick, name="talk")
        self.had_settings = self.context.spec.settings_type.partition(":")[0] in sys.modules

    def test_results(self) -> list[tuple[str, bool, str]]:
        return [("settings imported before", self.had_settings, "")]

    def tick(self) -> None:
        self.publisher.publish(self.message(data="hello"))


class Listener(Quiet):
    """Counts what arrives on its first subscription."""

    received = 0

    def configure(self) -> None:
        super().configure()
        self.context.subscribe(self.context.spec.subscriptions[0], self.receive)

    def receive(self, message: Any, received_ns: int) -> None:
        assert message.data == "hello"
        assert received_ns > 0
        self.received += 1
        if self.received == 10:
            self.note("heard")

    def test_results(self) -> list[tuple[str, bool, str]]:
        return [("received", self.received > 0, str(self.received))]


class BadCallback(Listener):
    """Fails in the callback of its subscription."""

    def receive(self, message: Any, received_ns: int) -> None:
        raise RuntimeError("the callback is broken")


class OwnTopic(Quiet):
    """Publishes below its own name."""

    def configure(self) -> None:
        super().configure()
        from joshua.messages import message_class

        message = message_class("std_msgs/msg/String")(data="mine")
        topic = TopicSpec(name="~/command", type_name="std_msgs/msg/String", rate_hz=50.0)
        publisher = self.context.publisher(topic)
        assert publisher.topic.name == f"{self.context.spec.full_name}/command"
        self.context.create_timer(0.02, lambda: publisher.publish(message))


class FailsIn(Quiet):
    """Raises in the step that its settings name."""

    def note(self, step: str) -> None:
        super().note(step)
        if self.context.spec.settings.get("fails_in") == step:
            raise RuntimeError(f"broken in {step}")


class NoDevice(Quiet):
    """Finds no device."""

    def configure(self) -> None:
        super().configure()
        raise DeviceError("the arm on /dev/ttyACM7 does not answer: plug it in or correct comm.serial.port")


class WrongFile(Quiet):
    """Is configured with a file that does not exist."""

    def configure(self) -> None:
        super().configure()
        raise ConfigurationError("model_path names arm.xml, which does not exist: correct it")


class Silent(Quiet):
    """Declares its topics and publishes nothing."""

    def configure(self) -> None:
        super().configure()
        for topic in self.context.spec.publishers:
            self.context.publisher(topic)


class Unplugged(Quiet):
    """Its device disconnects while it runs, so that it cannot be brought into its safe state."""

    def activate(self) -> None:
        super().activate()
        self.context.create_timer(0.01, self.deactivate, name="control")

    def deactivate(self) -> None:
        raise DeviceError("the adapter on /dev/ttyACM7 is disconnected: check its cable")


class MissingModule(Quiet):
    """Needs a module that is not installed."""

    def configure(self) -> None:
        import module_that_nobody_has  # type: ignore[import-not-found]  # noqa: F401


class ExitsItself(Quiet):
    """Calls ``sys.exit`` in its configure step."""

    def configure(self) -> None:
        super().configure()
        sys.exit(0)


class InTimer(Quiet):
    """Does something once in a timer, after so many ticks; by class below."""

    after_ticks = 10

    def configure(self) -> None:
        super().configure()
        self.count = 0
        self.context.create_timer(0.01, self.tick, name="once")

    def tick(self) -> None:
        self.count += 1
        if self.count == self.after_ticks and self.wanted():
            self.note("acts")
            self.act()
            self.note("acted")

    def wanted(self) -> bool:
        """Only before the first restart, where the settings say so."""
        spec = self.context.spec
        return not (spec.settings.get("once") and spec.facts.restarted)

    def act(self) -> None:
        raise NotImplementedError


class Raises(InTimer):
    def act(self) -> None:
        raise RuntimeError("the timer is broken")


class Recurs(NodeError):
    """A failure that a restart would meet again."""

    is_permanent = True


class RaisesForGood(InTimer):
    def act(self) -> None:
        raise Recurs("the weights are not a number")


class ComesBackSlowly(Raises):
    """Fails once, and is not through with its start when the run ends."""

    def configure(self) -> None:
        super().configure()
        while self.context.spec.facts.restarted and not self.context.stopping:
            time.sleep(0.01)


class Segfaults(InTimer):
    def act(self) -> None:
        ctypes.string_at(0)


class KillsItself(InTimer):
    def act(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Sleeps(InTimer):
    """Hangs where Python can interrupt it."""

    def act(self) -> None:
        time.sleep(1000)


class Spins(InTimer):
    """Hangs in a busy loop."""

    def act(self) -> None:
        while True:
            pass


class HoldsInterpreter(InTimer):
    """Hangs in native code that never gives the interpreter away."""

    def act(self) -> None:
        library = ctypes.PyDLL(None)
        mutex = ctypes.create_string_buffer(64)
        library.pthread_mutex_lock(mutex)
        library.pthread_mutex_lock(mutex)


class EndsRun(InTimer):
    def act(self) -> None:
        self.context.end_run("calibration is written")


class Warns(Quiet):
    def configure(self) -> None:
        super().configure()
        self.context.warn("the latency timer is 16 ms: set it to 1 ms")


class Chats(Quiet):
    """Logs a line at 20 Hz."""

    def configure(self) -> None:
        super().configure()
        self.context.create_timer(0.05, lambda: self.context.log.info("still here"), name="chat")


class SeesGraph(Quiet):
    """Looks at the ROS 2 graph and at /rosout from a transport session of its own."""

    def configure(self) -> None:
        super().configure()
        from joshua.messages import decode
        from joshua.plan import QosProfile, TransportSettings
        from joshua.transport import open_transport

        spec = TransportSettings.model_validate(self.context.spec.settings["transport"])
        self.transport = open_transport(spec)
        self.lines: list[str] = []
        self.nodes: set[str] = set()
        self.topics: set[str] = set()
        kind = "rcl_interfaces/msg/Log"

        def receive(sample: Any) -> None:
            log = decode(kind, sample.cdr)
            self.lines.append(f"{log.level} {log.name}: {log.msg}")

        handle = self.transport.create_node("onlooker")
        handle.create_subscription("/rosout", kind, QosProfile(durability="TRANSIENT_LOCAL"), receive)
        self.context.create_timer(0.05, self.look, name="look")

    def look(self) -> None:
        found = {f"{node.namespace.rstrip('/')}/{node.name}" for node in self.transport.nodes()}
        self.nodes |= found
        silent = [node for node in self.transport.nodes() if node.name == "seesgraph"]
        self.topics |= {item.topic for node in silent for item in node.endpoints if item.is_publisher}
        if any("still here" in line for line in self.lines) and {"/left/chats"} < self.nodes and self.topics:
            self.context.end_run("seen")

    def test_results(self) -> list[tuple[str, bool, str]]:
        return [
            ("lines", True, "\n".join(self.lines)),
            ("nodes", True, " ".join(sorted(self.nodes))),
            ("topics", True, " ".join(sorted(self.topics))),
        ]

    def cleanup(self) -> None:
        super().cleanup()
        self.transport.close()


class Floods(InTimer):
    """Logs far too much, by the logger and on standard output."""

    def act(self) -> None:
        for index in range(20_000):
            self.context.log.info("flood %d", index)
        sys.stdout.write("printed flood\n" * 20_000)
        sys.stdout.flush()


class WritesOddly(InTimer):
    """Writes a huge line, bytes that are no UTF-8, control characters, and an unfinished line."""

    def act(self) -> None:
        self.context.log.info("huge %s", "x" * 100_000)
        self.context.log.info("surrogate \udc80 and %s", b"bytes")
        self.context.log.info("wrong number of arguments %d %d", 1)
        os.write(1, b"y" * 100_000 + b"\n")
        os.write(1, b"not utf-8: \xff\xfe\n")
        os.write(2, b"escape \x1b[31m red\n")
        os.write(1, b"unfinished")


class SlowStart(Quiet):
    """Waits in its configure step, and says for what."""

    def configure(self) -> None:
        self.note("configure")
        self.context.waiting_for("an answer of motor 3")
        time.sleep(1000)


class SlowLoad(Quiet):
    """Computes for a while in its configure step."""

    def configure(self) -> None:
        super().configure()
        end_s = time.process_time() + 2.5
        while time.process_time() < end_s:
            pass


class IgnoresStop(Quiet):
    """Does not come back from its deactivate step."""

    def deactivate(self) -> None:
        super().deactivate()
        while True:
            time.sleep(1000)


class IgnoresEverything(InTimer):
    """Blocks in a timer, and cannot be interrupted."""

    def act(self) -> None:
        while True:
            try:
                time.sleep(1000)
            except BaseException:  # noqa: BLE001
                continue


class Reader(Quiet):
    """Has a reader thread; by its settings that one fails or hangs."""

    def configure(self) -> None:
        super().configure()
        self.context.spawn_thread(self.read, name="reader", hang_after_s=0.5)

    def read(self) -> None:
        what = self.context.spec.settings.get("reader", "")
        while not self.context.stopping:
            if what == "fails":
                raise DeviceError("the camera at /dev/video9 is gone: plug it in again")
            time.sleep(1000 if what == "hangs" else 0.01)


def string_topic(name: str, rate_hz: float = 0.0) -> TopicSpec:
    """A topic of strings."""
    return TopicSpec(name=name, type_name="std_msgs/msg/String", rate_hz=rate_hz)
