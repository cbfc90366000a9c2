"""The models of this distribution, by name; importing this module does not load MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

MODELS_FOLDER = Path(__file__).parent / "models"


@dataclass(frozen=True)
class PackagedModel:
    """One model file.

    Attributes:
        name: value for ``model_path``, such as ``so_arm100/scene.xml``.
        summary: one-line description.
        mjx: name of the variant for accelerators (MJX); "" if there is none.
    """

    name: str
    summary: str
    mjx: str = ""

    @property
    def path(self) -> Path:
        """The MJCF file."""
        return MODELS_FOLDER / self.name


PACKAGED_MODELS: tuple[PackagedModel, ...] = (
    PackagedModel(
        "so_arm100/so_arm100.xml", "SO-ARM100, the arm alone: six joints", "so_arm100/so_arm100_mjx.xml"
    ),
    PackagedModel(
        "so_arm100/scene.xml", "SO-ARM100 on a table, cameras top, wrist, front", "so_arm100/scene_mjx.xml"
    ),
    PackagedModel("so_arm100/reach.xml", "SO-ARM100 with a place to reach", "so_arm100/reach_mjx.xml"),
    PackagedModel(
        "so_arm100/pick_place.xml",
        "SO-ARM100 with a cube to pick up and a goal to put it on",
        "so_arm100/pick_place_mjx.xml",
    ),
    PackagedModel("lekoch/lekoch.xml", "LeKoch alone: SO-ARM100 on three omnidirectional wheels"),
    PackagedModel(
        "lekoch/scene.xml", "LeKoch on a floor, cameras front, wrist, above, side", "lekoch/scene_mjx.xml"
    ),
    PackagedModel("ant/ant.xml", "the four-legged benchmark: eight joints", "ant/ant_mjx.xml"),
)


def packaged_names() -> tuple[str, ...]:
    """Return every name for ``model_path``, variants for accelerators last."""
    names = [model.name for model in PACKAGED_MODELS]
    return (*names, *(model.mjx for model in PACKAGED_MODELS if model.mjx))


def find_packaged(name: str) -> Path | None:
    """Return the file of a packaged model; None if no model has that name."""
    return MODELS_FOLDER / name if name in packaged_names() else None


def similar_names(name: str) -> tuple[str, ...]:
    """Return the names of packaged models, the closest match first."""
    names = packaged_names()
    near = get_close_matches(name, names, n=3, cutoff=0.5)
    return (*near, *(other for other in names if other not in near))
