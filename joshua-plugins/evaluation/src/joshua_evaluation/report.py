"""Self-contained HTML page: figures with intervals, plots, videos of some episodes."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from joshua_evaluation.metrics import Episode
from joshua_evaluation.results import Judged

#: Episodes in the table at the end; the CSV file has all.
MOST_ROWS = 200

_COLOURS = ("var(--a)", "var(--b)")


@dataclass(frozen=True)
class Clip:
    """Video of an episode: MP4, and its caption."""

    mp4: bytes
    caption: str


def page(results: Mapping[str, Any], judged: Sequence[Judged], clips: Sequence[Clip], note: str = "") -> str:
    """Make the report.

    Args:
        results: content of ``results.json``; clips: the best episodes first; note: what is missing, "" for
            nothing.
    """
    reward = results["reward_function"]
    title = f"Evaluation {'in' if reward else 'on'} {results['environment']}"
    seeds = results["seeds"]
    span = f"seeds {seeds[0]} to {seeds[-1]}" if seeds else "no episode"
    varied = ", randomised physics" if results.get("randomise") else ""
    rules = (
        f"{span}{varied}, reward {_text(reward)}"
        if reward
        else "marked by a person; a robot gives no reward, so there is no return"
    )
    parts = [
        f"<h1>{_text(title)}</h1>",
        f"<p>{results['episodes']} episodes ({rules}), "
        f"intervals of {100 * results['confidence']:.4g} %. {_text(str(results.get('started', '')))}</p>",
        "".join(
            f"<p><span class=key style='background:{_COLOURS[index % 2]}'></span>{_text(one.name)}</p>"
            for index, one in enumerate(judged)
        ),
    ]
    if not results.get("complete", True):
        parts.append(
            f"<p class=notice>Stopped after {results['episodes']} of {results['wanted']} episodes.</p>"
        )
    parts += [f"<p class=notice>Left out: {_text(said)}.</p>" for said in results.get("failed", {}).values()]
    parts.append(_figures(results))
    if results.get("compared"):
        parts.append(_comparison(results))
        if results.get("order"):
            blind = "Both checkpoints played each start, in an order by chance that the person was not told."
            parts.append(f"<p>{blind}</p>")
    if reward:
        parts.append("<h2>Return of each episode</h2>" + _strip(judged))
    parts.append("<h2>Length of the episodes</h2>" + _lengths(judged))
    if any(_speed(episode) is not None for one in judged for episode in one.episodes[:1]):
        parts.append("<h2>Speed of the joints, best and worst episode</h2>" + _speeds(judged[0]))
    if clips or note:
        parts.append("<h2>Best and worst episodes</h2>")
        parts.append(f"<p class=notice>{_text(note)}</p>" if note else "")
        parts.append(f"<div class=videos>{''.join(map(_clip, clips))}</div>")
    parts.append(_episodes(judged))
    parts.append(_facts(results))
    style = files("joshua_evaluation").joinpath("page.css").read_text(encoding="utf-8")
    return (
        "<!doctype html><html lang=en><meta charset=utf-8>"
        "<meta name=viewport content='width=device-width, initial-scale=1'>"
        f"<title>{_text(title)}</title><style>{style}</style>{''.join(parts)}</html>\n"
    )


def _text(value: str) -> str:
    return html.escape(value)


def _number(value: float | None, form: str = ".4g") -> str:
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def _interval(entry: Mapping[str, Any]) -> str:
    return "–" if entry["low"] is None else f"{_number(entry['low'])} to {_number(entry['high'])}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Make a table from cells of HTML."""
    top = "".join(f"<th>{_text(name)}</th>" for name in head)
    body = "".join(
        "<tr>"
        + "".join(f"<td{' class=main' if i == 1 else ''}>{cell}</td>" for i, cell in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f"<div class=wide><table><tr>{top}</tr>{body}</table></div>"


def _figures(results: Mapping[str, Any]) -> str:
    sides = [results["metrics"]]
    if results.get("compared"):
        sides.append(results["compared"]["metrics"])
    rows = []
    for name, entry in sides[0].items():
        label = _text(entry["label"]) + (f" ({_text(entry['unit'])})" if entry["unit"] else "")
        for index, side in enumerate(sides):
            own = side[name]
            key = f"<span class=key style='background:{_COLOURS[index]}'></span>" if len(sides) > 1 else ""
            method = "Wilson" if own["method"] == "wilson" else "bootstrap"
            rows.append((key + label, _number(own["value"]), _interval(own), method, str(own["count"])))
    return _table(("figure", "value", "interval", "method", "episodes"), rows)


def _comparison(results: Mapping[str, Any]) -> str:
    rows = []
    for name, entry in results["compared"]["differences"].items():
        about = results["metrics"][name]
        colour = ""
        p_value = 1.0 if entry["p_value"] is None else entry["p_value"]
        if about["higher_is_better"] is not None and p_value < 1 - results["confidence"]:
            colour = "good" if (entry["value"] > 0) == about["higher_is_better"] else "bad"
        rows.append(
            (
                _text(about["label"]),
                f"<span class='{colour}'>{_number(entry['value'], '+.4g')}</span>",
                _interval(entry),
                f"{entry['better']} / {entry['worse']}",
                _number(entry["p_value"], ".3g"),
                "McNemar" if entry["method"] == "mcnemar" else "bootstrap",
            )
        )
    head = ("second minus first", "difference", "interval", "larger / smaller", "p", "test")
    return "<h2>Comparison in the same episodes</h2>" + _table(head, rows)


def _axis(low: float, high: float) -> tuple[float, float]:
    if not math.isfinite(low) or not math.isfinite(high):
        return 0.0, 1.0
    margin = 0.06 * (high - low) or 0.5
    return low - margin, high + margin


def _strip(judged: Sequence[Judged]) -> str:
    """Plot a dot for each episode: return over number; hollow if it failed."""
    returns = [float(episode.rewards.sum()) for one in judged for episode in one.episodes]
    if not returns:
        return "<p>No episode was played.</p>"
    low, high = _axis(min(returns), max(returns))
    count = max(len(one.episodes) for one in judged)
    dots = []
    for index, one in enumerate(judged):
        for number, episode in enumerate(one.episodes):
            value = float(episode.rewards.sum())
            x, y = 60 + 900 * (number + 0.5) / count, 190 - 170 * (value - low) / (high - low)
            fill = "none" if episode.success is False else _COLOURS[index % 2]
            told = f"episode {number}, seed {episode.seed}: return {value:.4g}, {episode.steps} steps"
            told += f", {episode.outcome}" if episode.outcome else ""
            dots.append(
                f"<circle cx={x:.1f} cy={y:.1f} r=4 fill='{fill}' stroke='{_COLOURS[index % 2]}' "
                f"stroke-width=1.5><title>{told}</title></circle>"
            )
    return (
        "<svg viewBox='0 0 980 220' role=img aria-label='return of each episode'>"
        f"{_frame(low, high, 20, 190)}{''.join(dots)}<text x=60 y=212>episode 0</text>"
        f"<text x=960 y=212 text-anchor=end>{count - 1}</text>"
        f"</svg>{'<p>Filled: success. Hollow: no success.</p>' if _judges(judged) else ''}"
    )


def _judges(judged: Sequence[Judged]) -> bool:
    """Whether something judges the success of the episodes."""
    return all(episode.success is not None for one in judged for episode in one.episodes)


def _frame(low: float, high: float, top: int, bottom: int) -> str:
    lines = []
    for share in (0.0, 0.5, 1.0):
        y = bottom - (bottom - top) * share
        lines.append(
            f"<line x1=60 x2=960 y1={y:.1f} y2={y:.1f} stroke='var(--line)'/>"
            f"<text x=52 y={y + 4:.1f} text-anchor=end>{low + (high - low) * share:.3g}</text>"
        )
    return "".join(lines)


def _lengths(judged: Sequence[Judged]) -> str:
    lengths = [[episode.steps for episode in one.episodes] for one in judged]
    longest = max((max(values, default=1) for values in lengths), default=1)
    edges = np.linspace(0, longest, min(30, longest) + 1)
    counts = [np.histogram(values, edges)[0] for values in lengths]
    most = max(1, max(int(values.max()) for values in counts))
    width = 900 / (len(edges) - 1)
    bars = []
    for index, values in enumerate(counts):
        part = (width - 2) / len(counts)
        for number, value in enumerate(values):
            height = 110 * value / most
            if value:
                bars.append(
                    f"<rect x={60 + width * number + part * index:.1f} y={130 - height:.1f} width={part:.1f} "
                    f"height={height:.1f} fill='{_COLOURS[index % 2]}'><title>{value} episodes of up to "
                    f"{edges[number + 1]:.0f} steps</title></rect>"
                )
    return (
        f"<svg viewBox='0 0 980 150' role=img aria-label='length of the episodes'>{_frame(0, most, 20, 130)}"
        f"{''.join(bars)}<text x=60 y=146>0</text>"
        f"<text x=960 y=146 text-anchor=end>{longest} steps</text></svg>"
    )


def _speed(episode: Episode) -> Any:
    positions = episode.observations.get("observation.state")
    if positions is None or len(positions) < 2:
        return None
    return np.linalg.norm(np.diff(np.asarray(positions, np.float64), axis=0), axis=1) / episode.period_s


def _speeds(judged: Judged) -> str:
    order = judged.order
    chosen = [("best", judged.episodes[order[0]], "var(--good)")]
    if len(order) > 1:
        chosen.append(("worst", judged.episodes[order[-1]], "var(--bad)"))
    curves = [(label, _speed(episode), colour, episode) for label, episode, colour in chosen]
    longest = max(len(values) for _, values, _, _ in curves)
    high = max(float(values.max()) for _, values, _, _ in curves) or 1.0
    lines = []
    for label, values, colour, episode in curves:
        points = " ".join(
            f"{60 + 900 * (k + 0.5) / longest:.1f},{170 - 150 * value / high:.1f}"
            for k, value in enumerate(values)
        )
        lines.append(
            f"<polyline points='{points}' fill=none stroke='{colour}' stroke-width=2>"
            f"<title>{label}: seed {episode.seed}</title></polyline>"
        )
    keys = " ".join(
        f"<span class=key style='background:{colour}'></span>{label}: seed {episode.seed}"
        for label, _, colour, episode in curves
    )
    seconds = longest * curves[0][3].period_s
    return (
        f"<svg viewBox='0 0 980 195' role=img aria-label='speed of the joints'>{_frame(0, high, 20, 170)}"
        f"{''.join(lines)}<text x=60 y=190>0 s</text>"
        f"<text x=960 y=190 text-anchor=end>{seconds:.3g} s</text></svg>"
        f"<p>{keys}. Norm over all joints, rad/s.</p>"
    )


def _clip(clip: Clip) -> str:
    data = base64.b64encode(clip.mp4).decode()
    return (
        "<figure><video controls muted loop playsinline preload=auto "
        f"src='data:video/mp4;base64,{data}'></video>"
        f"<figcaption>{_text(clip.caption)}</figcaption></figure>"
    )


def _episodes(judged: Sequence[Judged]) -> str:
    rows, judges = [], _judges(judged)
    for index, one in enumerate(judged):
        key = f"<span class=key style='background:{_COLOURS[index % 2]}'></span>" if len(judged) > 1 else ""
        for number, episode in enumerate(one.episodes[:MOST_ROWS]):
            done = "<span class=good>success</span>" if episode.success else "<span class=bad>no</span>"
            won = (done,) if judges else ()
            figures = (_number(one.values[metric.name][number]) for metric in one.metrics if not metric.rate)
            rows.append((f"{key}{number}", *won, str(episode.seed), str(episode.steps), *figures))
    success = ("success",) if judges else ()
    head = ("episode", *success, "seed", "steps", *(m.label for m in judged[0].metrics if not m.rate))
    return f"<details><summary>All episodes</summary>{_table(head, rows)}</details>"


def _facts(results: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {value}" for name, value in results.get("versions", {}).items())
    return f"<p>{_text(versions)}</p>" if versions else ""
