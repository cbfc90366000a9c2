"""Runs a plan in a process of its own, as the command line does: fork server first.

Arguments: path of the plan (JSON), folder of the logs, folder of the run directories. It prints one JSON
object a line.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from joshua.supervisor import fork_server


def main() -> int:
    server = fork_server.start()
    show({"fork_server": server.process_id})
    from joshua.plan import Plan
    from joshua.supervisor.policies import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor

    plan = Plan.model_validate_json(Path(sys.argv[1]).read_text())
    logs, runs = Path(sys.argv[2]), Path(sys.argv[3])
    options = SupervisorOptions(run_base=runs, log_directory=logs, log_level=10)
    try:
        report = Supervisor(plan, server, options, print_event).run()
    finally:
        server.close()
    show({"exit_code": report.exit_code, "reason": report.reason})
    return report.exit_code


def show(record: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(record) + "\n")
    sys.stdout.flush()


def print_event(event: Any) -> None:
    from joshua.plan.events import event_name

    name = event_name(event)
    if name == "table":
        show({"ready": {row.full_name: row.process_id for row in event.nodes}})
    elif name == "log":
        show({"log": event.text, "node": event.node, "level": event.level_name})
    elif name == "report":
        show({"reasons": {node.full_name: node.reason for node in event.nodes}})
        show({"states": {node.full_name: node.state for node in event.nodes}})
    elif name != "status":
        show({"event": name, "node": event.node})


if __name__ == "__main__":
    sys.exit(main())
