"""``joshua dataset upload`` and ``download``."""

from __future__ import annotations

import argparse
import shutil
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.tools import positive_seconds, printable, raw

if TYPE_CHECKING:
    from joshua_dataset.cloud.store import Tally

ACTIONS = ("upload", "download")

ADDRESS_HELP = "such as hf://datasets/NAME/DATA, s3://BUCKET/FOLDER or gs://BUCKET/FOLDER"


def add_actions(actions: Any) -> None:
    """Add both actions to ``joshua dataset``."""
    upload = actions.add_parser(
        "upload", help="copy a data set to a remote, skipping files that are already there"
    )
    upload.add_argument("folder", type=Path, metavar="FOLDER")
    upload.add_argument("url", metavar="URL", help=ADDRESS_HELP)
    upload.add_argument(
        "--replace",
        action="store_true",
        help="replace remote files that differ, and remove those that do not exist locally",
    )
    download = actions.add_parser("download", help="copy a data set from a remote")
    download.add_argument("url", metavar="URL", help=ADDRESS_HELP)
    download.add_argument("folder", type=Path, metavar="FOLDER")
    for parser in (upload, download):
        parser.add_argument("--jobs", type=_jobs, default=4, metavar="N", help="files at once (default 4)")
        parser.add_argument(
            "--patience",
            type=positive_seconds,
            default=60.0,
            metavar="SECONDS",
            help="how long to retry without network traffic (default 60)",
        )
        parser.epilog = (
            "Credentials come from the environment or the files of the remote's own tools. "
            "To resume a stopped transfer, run the same command again."
        )


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Exit code 0; 1 if it failed, 2 for a wrong URL, 3 for a missing library."""
    from joshua.tools import ExitCode

    from joshua_dataset.cloud.address import AddressError
    from joshua_dataset.cloud.copies import store_of
    from joshua_dataset.cloud.download import download
    from joshua_dataset.cloud.errors import RemoteError
    from joshua_dataset.cloud.store import Tally
    from joshua_dataset.cloud.upload import upload

    stop = threading.Event()
    screen = _Screen()
    tally = Tally(screen.show, stop.is_set, screen.note, arguments.patience)
    name = f"joshua dataset {arguments.action}"
    try:
        store = store_of(arguments.url)
        if arguments.action == "upload":
            done = upload(arguments.folder, store, tally, jobs=arguments.jobs, replace=arguments.replace)
        else:
            done = download(store, arguments.folder, tally, jobs=arguments.jobs)
    except KeyboardInterrupt:
        stop.set()
        screen.end()
        sys.stderr.write(f"{name}: stopped. {tally.done_files} of {tally.files} files are complete. ")
        sys.stderr.write("Run the same command again to resume\n")
        return ExitCode.INTERRUPTED
    except AddressError as error:
        remedy = f". {error.remedy}" if error.remedy else ""
        allowed = f"; allowed: {', '.join(error.allowed)}" if error.allowed else ""
        sys.stderr.write(f"{name}: {error}{allowed}{remedy}\n")
        return ExitCode.INVALID
    except RemoteError as error:
        screen.end()
        sys.stderr.write(f"{name}: {error}\n")
        if tally.moved_files:
            sys.stderr.write(f"{tally.done_files} of {tally.files} files are complete. ")
            sys.stderr.write("Run the same command again to resume\n")
        return error.exit_code
    screen.end()
    sys.stdout.write(f"{done}\n")
    return ExitCode.OK


class _Screen:
    """One line of progress on a terminal; failed attempts have lines of their own."""

    def __init__(self) -> None:
        self._is_terminal = sys.stderr.isatty()
        self._shown = False

    def show(self, tally: Tally) -> None:
        if self._is_terminal:
            from joshua_dataset.cloud.copies import progress_text

            width = shutil.get_terminal_size().columns
            raw(sys.stderr).write(f"\r\x1b[K{printable(progress_text(tally)[: width - 1])}")
            sys.stderr.flush()
            self._shown = True

    def note(self, text: str) -> None:
        self.end()
        sys.stderr.write(f"{text}\n")

    def end(self) -> None:
        if self._shown:
            raw(sys.stderr).write("\r\x1b[K")
            self._shown = False


def _jobs(text: str) -> int:
    """Parse a number of files from 1 to 64."""
    number = int(text)
    if not 1 <= number <= 64:
        raise argparse.ArgumentTypeError(f"{text} is not between 1 and 64")
    return number
