from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from emulated_v4l2 import EmulatedDevices
from joshua_emulator.camera.frame_code import FrameCode
from joshua_emulator.camera.frames import frame_factory


@pytest.fixture(scope="session")
def v4l2_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not sys.platform.startswith("linux") or compiler is None:
        pytest.skip("emulated V4L2 devices need Linux and a C compiler (apt install gcc libc6-dev)")
    library = tmp_path_factory.mktemp("v4l2") / "emulated_v4l2.so"
    source = Path(__file__).with_name("emulated_v4l2.c")
    command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl", "-lpthread"]
    built = subprocess.run(command, capture_output=True, text=True)
    if built.returncode and "linux/videodev2.h" in built.stderr:
        pytest.skip("emulated V4L2 devices need the kernel's headers (apt install linux-libc-dev)")
    assert built.returncode == 0, built.stderr
    return library


@pytest.fixture
def devices(v4l2_library: Path, tmp_path: Path) -> EmulatedDevices:
    """A folder for emulated devices."""
    folder = tmp_path / "devices"
    folder.mkdir()
    return EmulatedDevices(folder, v4l2_library)


@pytest.fixture(scope="session")
def frame() -> bytes:
    """A JPEG frame of 640 × 480 with the number 77."""
    return frame_factory(640, 480).frame(FrameCode(77, 1))
