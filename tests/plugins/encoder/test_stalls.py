"""Stalls of the machine at any point of a request: no encoder is blamed for them, but a silent one is.

The AMT21 is an emulated one behind its real protocol, on a line in virtual time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import pytest
from encoder_settings import make_settings
from hypothesis import given, settings
from hypothesis import strategies as st
from joshua.api import DeviceDisconnected
from joshua.api.patience import Patience
from joshua.guardian.silence import LEAST_MISSES, PATIENCE_FACTOR
from joshua_emulator.encoder.device import AMT21, EncoderDevice
from joshua_emulator.event_log import EventLog
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_encoder import sources
from joshua_encoder.sources import STALE_S, Amt21Source
from stalling_line import STALLS, StallingLine
from stepped_time import SteppedTime

RESOLUTION = 16384


@contextmanager
def stalling(
    stalls: list[tuple[int, float, bool, bool]],
) -> Iterator[tuple[Amt21Source, StallingLine, EncoderDevice]]:
    """An AMT21 on a line that stalls, the line, and the emulated encoder."""
    clock = SteppedTime()
    device = EncoderDevice(AMT21, RESOLUTION, sources.AMT21_BAUDRATE, EventLog(), LineFaults())
    line = StallingLine(device, clock)
    line.baudrate = sources.AMT21_BAUDRATE
    line.stalls = {at: rest for at, *rest in stalls}  # type: ignore[misc]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sources, "time", clock)
        patch.setattr(sources, "Patience", partial(Patience, waited=lambda: line.waited_s))
        chosen = make_settings("line", "amt21", sources.AMT21_BAUDRATE, resolution=RESOLUTION)
        yield Amt21Source(line, chosen), line, device  # type: ignore[arg-type]


@settings(max_examples=100, deadline=None)
@given(stalls=st.lists(STALLS, max_size=4))
def test_a_sound_encoder_is_never_blamed(stalls: list[tuple[int, float, bool, bool]]) -> None:
    with stalling(stalls) as (source, line, _):
        source.start()
        counted = 0
        while line.calls < 60:
            counted += len(source.read(math.inf))
        assert counted


def read_on(source: Amt21Source) -> None:
    while True:
        source.read(math.inf)


@settings(max_examples=150, deadline=None)
@given(stalls=st.lists(STALLS, max_size=6))
def test_a_silent_encoder_is_blamed_for_awake_time_only(stalls: list[tuple[int, float, bool, bool]]) -> None:
    with stalling(stalls) as (source, line, device):
        source.start()
        device.silent = True
        began_s, stalled_s = line.awake_s(), line.stalled_s
        stopped = line.stopped
        with pytest.raises(DeviceDisconnected) as caught:
            read_on(source)
        awake_s = line.awake_s() - began_s
        if "too busy" in str(caught.value):
            assert line.stalled_s - stalled_s + awake_s >= STALE_S * PATIENCE_FACTOR
            return
        # A stop, and a wait before the first miss, count as much as a request.
        counted_s = (line.stopped - stopped + 1) * STALE_S / LEAST_MISSES
        assert STALE_S - counted_s <= awake_s <= STALE_S + 0.3
