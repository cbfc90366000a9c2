"""Loading of ``model_path``, with error messages that give a remedy."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
from joshua.api import ConfigurationError
from joshua.tools import describe_pointers

from joshua_mujoco_sim.catalog import find_packaged, similar_names
from joshua_mujoco_sim.urdf import is_urdf, read_urdf


class ModelError(ConfigurationError):
    """A model cannot be found, read or compiled. The message gives place, reason and remedy."""


def model_file(model_path: str, folder: Path | None = None) -> Path:
    """Find the file that ``model_path`` names.

    Args:
        model_path: name of a packaged model, or a path of an MJCF or URDF file.
        folder: base of relative paths; None means the current folder.

    Raises:
        ModelError: nothing of that name exists; lists the nearest packaged models.
    """
    packaged = find_packaged(model_path)
    if packaged is not None:
        return packaged
    expanded = Path(os.path.expanduser(model_path))  # noqa: PTH111 - an unknown user stays as written
    path = expanded if expanded.is_absolute() else (folder or Path.cwd()) / expanded
    if path.is_file():
        return path
    kind = "is a folder" if path.is_dir() else "does not exist"
    names = ", ".join(similar_names(model_path)[:3])
    raise ModelError(
        f"model_path {model_path!r}: {path} {kind}, and no packaged model has that name (nearest: {names}): "
        "write the path of an MJCF or URDF file relative to the configuration, or one of `joshua models`"
    )


@dataclass(frozen=True)
class Attachment:
    """A model attached to the scene of another one.

    Attributes:
        model_path: packaged name or path; prefix: of its names, with a trailing slash.
        position_m: of its origin; yaw_rad: rotation about the vertical.
    """

    model_path: str
    prefix: str
    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0


def load_model(
    model_path: str, folder: Path | None = None, attached: Sequence[Attachment] = ()
) -> mujoco.MjModel:
    """Compile the model that ``model_path`` names, with others attached to its scene.

    Raises:
        ModelError: the file is missing or malformed; names the line if MuJoCo reports it.
    """
    path = model_file(model_path, folder)
    try:
        if not attached and not is_urdf(path):
            return mujoco.MjModel.from_xml_path(str(path))
        scene = _read(path)
        for attachment in attached:
            _attach(scene, attachment, folder)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the options of the scene apply to everything in it
            return scene.compile()
    except (ValueError, mujoco.FatalError) as error:
        pointers = _pointers(path, *(model_file(other.model_path, folder) for other in attached))
        if pointers is not None:
            raise ModelError(f"{path} cannot be compiled: {'. '.join(pointers)}") from error
        reason = " ".join(str(error).split())
        raise ModelError(
            f"{path} is not a model that MuJoCo can compile: {reason}: correct the file"
        ) from error
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror or error}") from error


def _pointers(*paths: Path) -> tuple[str, str] | None:
    """Return what is wrong with the files that models load, if some are Git LFS pointers, and the remedy."""
    for path in paths:
        try:
            spec = mujoco.MjSpec.from_file(str(path))
        except (ValueError, mujoco.FatalError):
            continue  # the text itself is malformed, which MuJoCo's own error says
        loaded = [_of_model(path, spec.meshdir, mesh.file) for mesh in spec.meshes]
        loaded += [_of_model(path, spec.meshdir, field.file) for field in spec.hfields]
        loaded += [_of_model(path, spec.texturedir, texture.file) for texture in spec.textures]
        found = describe_pointers(path.parent, [file for file in loaded if file is not None])
        if found is not None:
            return found
    return None


def _of_model(path: Path, folder: str, name: str) -> Path | None:
    """Return the file that a model loads by a name in one of its folders; None without a name."""
    return path.parent / folder / name if name else None


def _read(path: Path) -> mujoco.MjSpec:
    return read_urdf(path) if is_urdf(path) else mujoco.MjSpec.from_file(str(path))


def _attach(scene: mujoco.MjSpec, attachment: Attachment, folder: Path | None) -> None:
    model = _read(model_file(attachment.model_path, folder))
    half = attachment.yaw_rad / 2
    frame = scene.worldbody.add_frame(
        pos=list(attachment.position_m), quat=[math.cos(half), 0, 0, math.sin(half)]
    )
    for body in list(model.worldbody.bodies):
        frame.attach_body(body, attachment.prefix, "")
