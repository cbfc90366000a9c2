"""Checks of ``joshua doctor`` for cameras: permissions and shared USB bandwidth."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from joshua.tools import DoctorResult, ExitCode, Host, Level, Plan, may_open

from joshua_camera.devices import list_devices
from joshua_camera.source_text import SourceKind, device_path, source_kind

NAME = "USB"
HIGH_SPEED_MBIT_S = 480


def check_permissions(host: Host) -> Iterator[DoctorResult]:
    """Compare owner, group and mode of each camera with the user's session."""
    for path in sorted((host.root / "dev").glob("video[0-9]*")):
        yield may_open(host, str(path))


def check_bandwidth(host: Host) -> Iterator[DoctorResult]:
    """Count the cameras on each USB 2 bus."""
    cameras = defaultdict(set)
    for node in (host.root / "sys/class/video4linux").glob("*"):
        place = _usb_place(node)
        if place:
            cameras[place.partition("-")[0]].add(place)
    for bus, places in sorted(cameras.items()):
        speeds = {host.read(f"sys/bus/usb/devices/{place}/speed") for place in places}
        if len(places) > 1 and speeds & {"12", str(HIGH_SPEED_MBIT_S)}:
            yield DoctorResult(
                Level.NOTE,
                NAME,
                f"bus {bus}",
                f"{len(places)} cameras share the {HIGH_SPEED_MBIT_S} Mbit/s of one bus; "
                "uncompressed pictures of 640x480 at 30 Hz take 150 of them each",
                'set pixel_format: "MJPG", or plug a camera into a socket of another bus (see `lsusb -t`)',
            )


def _usb_place(node: Path) -> str:
    """Return the USB path of the device behind a sysfs node; "" if there is none."""
    device = (node / "device").resolve()
    for folder in (device, *device.parents):
        if (folder / "idVendor").is_file():
            return folder.name
    return ""


def check_cameras_of_file(host: Host, plan: Plan) -> Iterator[DoctorResult]:
    """Look for the camera of each node of a file, without opening it."""
    for spec in plan.nodes:
        if not spec.implementation.startswith("joshua_camera."):
            continue
        source = str(spec.settings.get("source") or "")
        if source and source_kind(source) is not SourceKind.DEVICE:
            continue
        path = device_path(source) if source else f"/dev/video{spec.settings.get('device_id', 0)}"
        if (host.root / path.lstrip("/")).exists():
            yield DoctorResult(Level.OK, "devices", spec.full_name, f"its camera {path} is plugged in")
            continue
        here = ", ".join(f"/dev/video{entry.index}" for entry in list_devices(host.root)) or "none"
        yield DoctorResult(
            Level.ERROR,
            "devices",
            spec.full_name,
            f"its camera {path} does not exist. Video devices here: {here}",
            f"plug it in, or run `joshua find-cameras --write CONFIG --node {spec.name} --camera PATH`",
            ExitCode.HARDWARE,
        )


CHECKS = (check_permissions, check_bandwidth)
PLAN_CHECKS = (check_cameras_of_file,)
