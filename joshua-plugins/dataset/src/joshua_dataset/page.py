"""Self-contained HTML page of a data set: curves, videos, timing, a table of the episodes."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from joshua_dataset.metadata import STAMP
from joshua_dataset.pictures import Encoder, Video
from joshua_dataset.reader import Dataset, Episode

#: Points of a curve on the page; longer episodes are thinned.
MOST_POINTS = 1500

#: Codecs that every browser plays; others are re-encoded for the page.
PLAYABLE = ("h264",)


def _asset(name: str) -> str:
    return files("joshua_dataset").joinpath(name).read_text(encoding="utf-8")


def write_page(folder: Path, page: Path, episodes: Sequence[int], scratch: Path) -> list[int]:
    """Write the page of a data set; return the episodes that it shows.

    Args:
        episodes: shown with curves and videos, () for the first three; the table lists all.
        scratch: folder for re-encoded videos.

    Raises:
        DatasetError: the data set cannot be read.
    """
    dataset = Dataset.read(folder)
    wanted = set(episodes) or set(range(min(3, dataset.episodes)))
    rows, sections, shown = [], [], []
    for episode in dataset.episode_list():
        columns = dataset.columns(episode)
        rows.append(_row(dataset, episode, columns))
        if episode.index in wanted:
            sections.append(_section(dataset, episode, columns, scratch))
            shown.append(episode.index)
    title = html.escape(folder.resolve().name)
    head = (
        f"<p>{dataset.episodes} episodes, {dataset.frames} frames, {dataset.frames / dataset.fps:.1f} s at "
        f"{dataset.fps} Hz. Robot: {html.escape(dataset.robot_type or 'not named')}.</p>"
    )
    names = (
        "episode",
        "task",
        "frames",
        "length",
        "interval p50",
        "p99",
        "longest",
        *(name.removesuffix("_ns").replace("_", " ") for name in dataset.counters),
    )
    table = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    page.write_text(
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title>"
        f"<style>{_asset('page.css')}</style>"
        f"<h1>{title}</h1>{head}<table><tr>{table}</tr>{''.join(rows)}</table>"
        f"{''.join(sections)}<script>{_asset('page.js')}</script></html>\n",
        encoding="utf-8",
    )
    return shown


def _intervals_ms(dataset: Dataset, columns: dict[str, Any]) -> Any:
    if STAMP in columns and len(columns[STAMP]) > 1:
        return np.diff(columns[STAMP]) / 1e6
    return np.array([1000 / dataset.fps])


def _counted(name: str, count: int) -> str:
    return f"{count / 1e6:.1f} ms" if name.endswith("_ns") else str(count)


def _row(dataset: Dataset, episode: Episode, columns: dict[str, Any]) -> str:
    steps = _intervals_ms(dataset, columns)
    figures = (np.quantile(steps, 0.5), np.quantile(steps, 0.99), steps.max())
    cells = [
        str(episode.index),
        html.escape(", ".join(episode.tasks)),
        str(episode.length),
        f"{episode.length / dataset.fps:.1f} s",
        *(f"{figure:.1f} ms" for figure in figures),
        *(_counted(name, episode.counts.get(name, 0)) for name in dataset.counters),
    ]
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _section(dataset: Dataset, episode: Episode, columns: dict[str, Any], scratch: Path) -> str:
    step = max(1, episode.length // MOST_POINTS)
    curves, parts = [], []
    for feature in dataset.features.numbers:
        if feature.unit == "ns" or not np.issubdtype(columns[feature.key].dtype, np.number):
            continue
        values = columns[feature.key].reshape(episode.length, -1)[::step]
        names = feature.names or tuple(map(str, range(values.shape[1])))
        time_s = np.arange(episode.length)[::step] / dataset.fps
        curves.append(
            {
                "names": names,
                "time_s": time_s.round(3).tolist(),
                "values": np.nan_to_num(values.astype(float)).round(4).tolist(),
            }
        )
        unit = f" ({feature.unit})" if feature.unit else ""
        labels = "".join(
            f"<span><i style='background:{_colour(i)}'></i>{html.escape(name)}</span>"
            for i, name in enumerate(names)
        )
        key = html.escape(feature.key + unit)
        parts.append(f"<div class=key>{key}</div><canvas></canvas><div class=names>{labels}</div>")
    videos = "".join(_video(dataset, episode, feature.key, scratch) for feature in dataset.features.pictures)
    end_s = max(0.0, (episode.length - 1) / dataset.fps)
    data = json.dumps(curves).replace("</", "<\\/")
    return (
        f"<section data-episode={episode.index}><h2>Episode {episode.index}: "
        f"{html.escape(', '.join(episode.tasks))}</h2><div class=videos>{videos}</div>"
        f"<p><input type=range min=0 max={end_s:.3f} step=0.01 value=0 style='width:80%' aria-label=time> "
        f"<output></output></p>{''.join(parts)}{_histogram(dataset, columns)}"
        f"<script type=application/json>{data}</script></section>"
    )


def _colour(number: int) -> str:
    colours = [
        "#1f77b4",
        "#ff7f0e",
        "#2ca02c",
        "#d62728",
        "#9467bd",
        "#8c564b",
        "#e377c2",
        "#7f7f7f",
        "#bcbd22",
        "#17becf",
    ]
    return colours[number % len(colours)]


def _video(dataset: Dataset, episode: Episode, key: str, scratch: Path) -> str:
    where = episode.pictures[key]
    own_file = "joshua" in dataset.info and dataset.pictures == "video"
    path = where.path
    if not own_file or dataset.codec not in PLAYABLE:
        height, width, _ = dataset.features[key].shape
        path = scratch / f"{episode.index}-{key}.mp4"
        encoder = Encoder(Video(path, width, height, dataset.fps), key, dataset.fps)
        for picture in dataset.decoded(episode, key):
            encoder.add(picture)
        encoder.finish()
    data = base64.b64encode(path.read_bytes()).decode()
    return (
        f"<figure style='margin:0'><video controls muted src='data:video/mp4;base64,{data}'></video>"
        f"<figcaption>{html.escape(key)}</figcaption></figure>"
    )


def _histogram(dataset: Dataset, columns: dict[str, Any]) -> str:
    """Return an SVG histogram of acquisition times relative to the frames, else of the frame intervals."""
    if "acquisition_ns" in columns:
        title, values = (
            "acquisition after the frame (ms)",
            columns["acquisition_ns"] - columns[STAMP][:, None],
        )
        values = values.ravel() / 1e6
    else:
        title, values = "interval between frames (ms)", _intervals_ms(dataset, columns)
    period_ms = 1000 / dataset.fps
    low, high = min(-period_ms, float(values.min())), max(2 * period_ms, float(values.max()))
    counts, edges = np.histogram(values, bins=30, range=(low, high))
    heights = 70 * counts / max(1, counts.max())
    bars = "".join(
        f"<rect x={8 + 20 * i} y={80 - height:.1f} width=18 height={height:.1f} fill='#1f77b4'/>"
        for i, height in enumerate(heights)
    )
    return (
        f"<div class=key>{title}</div><svg viewBox='0 0 620 100' width=620 height=100 role=img>{bars}"
        f"<text x=8 y=96 font-size=11 fill='#8a94a3'>{edges[0]:.0f}</text>"
        f"<text x=580 y=96 font-size=11 fill='#8a94a3'>{edges[-1]:.0f}</text></svg>"
    )
