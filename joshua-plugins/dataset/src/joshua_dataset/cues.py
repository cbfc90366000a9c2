"""Spoken cues for a person whose hands and eyes are on the robot."""

from __future__ import annotations

import shutil
import subprocess

from joshua.api import NodeContext

from joshua_dataset.session import Phase

#: Text-to-speech programs and their arguments; the first installed one is used.
SPEAKERS = (("spd-say", "--"), ("espeak-ng", "--"), ("espeak", "--"), ("say",))

#: Spoken text at the start of a phase.
TEXTS = {
    Phase.WARM_UP: "get ready",
    Phase.RECORDING: "recording episode {}",
    Phase.REVIEW: "stopped",
    Phase.RESET: "reset the scene",
    Phase.DONE: "all episodes are recorded",
}


class Cues:
    """Speaks short texts, one after the other; a newer text replaces waiting ones.

    Args:
        context: of the node; spoken: whether to speak.
    """

    def __init__(self, context: NodeContext, *, spoken: bool) -> None:
        self._command: tuple[str, ...] = ()
        self._speaking: subprocess.Popen[bytes] | None = None
        self._waiting = ""
        self._phase = Phase.IDLE
        if not spoken:
            return
        for program, *before in SPEAKERS:
            path = shutil.which(program)
            if path:
                self._command = (path, *before)
                return
        names = ", ".join(program for program, *_ in SPEAKERS)
        context.warn(f"spoken_cues has no effect: none of {names} is installed. Run `apt install espeak-ng`")

    def follow(self, phase: Phase, number: int) -> None:
        """Speak the text of a phase that has begun; called periodically.

        Args:
            number: of the episode.
        """
        self.tick()
        if phase is not self._phase:
            self._phase = phase
            self.say(TEXTS.get(phase, "").format(number))

    def say(self, text: str) -> None:
        """Speak a text without blocking."""
        self._waiting = text
        self.tick()

    def close(self) -> None:
        """Stop speaking."""
        self._waiting = ""
        if self._speaking is not None:
            self._speaking.kill()
            self._speaking.wait()

    def tick(self) -> None:
        """Speak the waiting text, if any; called periodically."""
        busy = self._speaking is not None and self._speaking.poll() is None
        if busy or not self._waiting or not self._command:
            return
        text, self._waiting = self._waiting, ""
        quiet = subprocess.DEVNULL
        try:
            self._speaking = subprocess.Popen([*self._command, text], stdin=quiet, stdout=quiet, stderr=quiet)
        except OSError:
            self._command = ()  # the program has gone
