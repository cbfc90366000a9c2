"""Intrinsic calibration: the YAML file of ROS 2's camera calibrator, and the message made from it."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from joshua.api import ConfigurationError
from joshua.messages import message_class
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

_MAX_BYTES = 1_000_000
_FILE = (
    "a YAML file with image_width, image_height, camera_matrix and distortion_coefficients, "
    "as ROS 2's camera_calibration writes it"
)


def _finite(values: tuple[float, ...]) -> tuple[float, ...]:
    if not all(map(math.isfinite, values)):
        raise ValueError("every number must be finite")
    return values


class _Matrix(BaseModel):
    """A matrix as the calibrator writes it: rows, columns, and values row by row."""

    model_config = ConfigDict(frozen=True)

    rows: int = Field(ge=1, le=16)
    cols: int = Field(ge=1, le=16)
    data: Annotated[tuple[float, ...], AfterValidator(_finite)]


class _File(BaseModel):
    model_config = ConfigDict(frozen=True)

    image_width: int = Field(gt=0)
    image_height: int = Field(gt=0)
    distortion_model: str = "plumb_bob"
    camera_matrix: _Matrix
    distortion_coefficients: _Matrix
    rectification_matrix: _Matrix | None = None
    projection_matrix: _Matrix | None = None


class Intrinsics(BaseModel):
    """Intrinsic calibration of a camera (sensor_msgs/msg/CameraInfo).

    Attributes:
        width, height: of the pictures that were calibrated, in pixels.
        model: of the distortion; distortion: its coefficients.
        camera: K, 3 × 3 row by row; rectification: R, 3 × 3; projection: P, 3 × 4.
    """

    model_config = ConfigDict(frozen=True)

    width: int
    height: int
    model: str = ""
    distortion: tuple[float, ...] = ()
    camera: tuple[float, ...]
    rectification: tuple[float, ...]
    projection: tuple[float, ...]


def uncalibrated(width: int, height: int) -> Intrinsics:
    """Return the CameraInfo of a camera without calibration: the size, and zeros."""
    return Intrinsics(
        width=width, height=height, camera=(0.0,) * 9, rectification=(0.0,) * 9, projection=(0.0,) * 12
    )


def load_intrinsics(path: str, width: int, height: int) -> Intrinsics:
    """Read a calibration for pictures of a size.

    Raises:
        ConfigurationError: the file cannot be read, is not a calibration, or is for another size.
    """
    content = _read(path)
    try:
        file = _File.model_validate(content)
    except ValidationError as error:
        details = error.errors()[:3]
        problems = "; ".join(f"{'.'.join(map(str, d['loc'])) or 'content'}: {d['msg']}" for d in details)
        raise ConfigurationError(
            f"{path} is not a camera calibration ({problems}): intrinsics_file names {_FILE}"
        ) from error
    if (file.image_width, file.image_height) != (width, height):
        raise ConfigurationError(
            f"{path} was calibrated at {file.image_width} × {file.image_height}, and the camera runs at "
            f"{width} × {height}: set that size, or calibrate at this one"
        )
    camera = _sized(path, "camera_matrix", file.camera_matrix, 3, 3)
    identity = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    plain = (*camera[0:3], 0.0, *camera[3:6], 0.0, *camera[6:9], 0.0)
    rectification, projection = file.rectification_matrix, file.projection_matrix
    return Intrinsics(
        width=width,
        height=height,
        model=file.distortion_model,
        distortion=file.distortion_coefficients.data,
        camera=camera,
        rectification=(
            identity if rectification is None else _sized(path, "rectification_matrix", rectification, 3, 3)
        ),
        projection=plain if projection is None else _sized(path, "projection_matrix", projection, 3, 4),
    )


def camera_info(intrinsics: Intrinsics, header: Any) -> Any:
    """Return the ``sensor_msgs/msg/CameraInfo`` for a picture with this header."""
    region = message_class("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)
    return message_class("sensor_msgs/msg/CameraInfo")(
        header,
        intrinsics.height,
        intrinsics.width,
        intrinsics.model,
        np.array(intrinsics.distortion, np.float64),
        np.array(intrinsics.camera, np.float64),
        np.array(intrinsics.rectification, np.float64),
        np.array(intrinsics.projection, np.float64),
        0,
        0,
        region,
    )


def _read(path: str) -> Any:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        with open(path, encoding="utf-8") as stream:  # noqa: PTH123 - the path is the user's own text
            text = stream.read(_MAX_BYTES + 1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ConfigurationError(f"{path} cannot be read ({reason}): correct intrinsics_file") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path} is not a text file: intrinsics_file names {_FILE}") from error
    if len(text) > _MAX_BYTES:
        raise ConfigurationError(f"{path} is too large for a calibration: intrinsics_file names {_FILE}")
    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, RecursionError, ValueError) as error:
        text = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"{path} is not valid YAML ({text}): intrinsics_file names {_FILE}"
        ) from error


def _sized(path: str, name: str, matrix: _Matrix, rows: int, columns: int) -> tuple[float, ...]:
    if (matrix.rows, matrix.cols) != (rows, columns) or len(matrix.data) != rows * columns:
        raise ConfigurationError(
            f"{path}: {name} has {matrix.rows} × {matrix.cols} with {len(matrix.data)} numbers, and takes "
            f"{rows} × {columns}: create the calibration again"
        )
    return matrix.data
