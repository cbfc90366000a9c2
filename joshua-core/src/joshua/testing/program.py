"""The program ``joshua`` as a child process, isolated from everything else on this machine."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from joshua.testing.port import free_port

#: Time that a run may take to shut down cleanly before it is killed.
STOP_S = 40.0

#: A router's port is this plus its domain: below the ephemeral ports of systems.
ROUTER_PORTS = 20_000


class JoshuaProgram:
    """Runs ``joshua`` with a separate domain, router, run directory and log folder.

    Args:
        folder: holds run directory and logs; also the working directory.
        domain_id: ROS 2 domain.
        environment: further variables.

    Attributes:
        router: Zenoh endpoint that runs get; "" leaves the file's transport block as it is.
    """

    def __init__(self, folder: Path, domain_id: int, environment: Mapping[str, str] | None = None) -> None:
        self.folder = folder
        self.router = f"tcp/localhost:{router_port(domain_id)}"
        runtime = folder / "runtime"
        runtime.mkdir(mode=0o700, exist_ok=True)
        self.environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain_id),
            "XDG_RUNTIME_DIR": str(runtime),
            "JOSHUA_LOG_DIR": str(folder / "log"),
            "NO_COLOR": "1",
            **(environment or {}),
        }
        self._started: list[subprocess.Popen[str]] = []

    def __call__(self, *arguments: str, timeout_s: float = 240.0) -> subprocess.CompletedProcess[str]:
        """Run ``joshua`` to its end.

        Args:
            arguments: of the command line. A run with ``--config`` gets its own router.
            timeout_s: after which it is stopped.

        Raises:
            subprocess.TimeoutExpired: it took longer. The exception contains the output.
        """
        process = self.start(*arguments)
        try:
            output, errors = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired as expired:
            output, errors = self.stop(process)
            raise subprocess.TimeoutExpired(process.args, timeout_s, output, errors) from expired
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Start ``joshua`` and return immediately. ``stop`` ends it, at the latest after the test."""
        process = subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", *self._with_router(arguments)],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._started.append(process)
        return process

    def stop(self, process: subprocess.Popen[str]) -> tuple[str, str]:
        """Stop a run like Ctrl-C, or kill it after ``STOP_S``. Return output and errors."""
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            return process.communicate(timeout=STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.communicate()

    def close(self) -> None:
        """Stop everything that still runs."""
        for process in self._started:
            if process.poll() is None:
                self.stop(process)
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()

    def _with_router(self, arguments: Sequence[str]) -> list[str]:
        if "--config" not in arguments or not self.router:
            return list(arguments)
        return [*arguments, "--set", f'transport.listen_endpoints="{self.router}"']


def router_port(domain_id: int) -> int:
    """Return the port of a domain's router. It is reserved together with the domain."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", ROUTER_PORTS + domain_id))
        except OSError:
            return free_port()
    return ROUTER_PORTS + domain_id
