"""Views to turn: plotly's figures without points, and the points and poses the page fills in."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pipeline.formats.walks import Walk
from pipeline.reporting.figures import BLUE, GREEN, ORANGE, Figure, layout
from pipeline.reporting.overlays import Cloud, KnownPair, Overlay, describe, thin
from pipeline.reporting.paper import shown

Pose = Float64[np.ndarray, "4 4"]
CAMERA = {"eye": {"x": 1.3, "y": 1.3, "z": 0.85}, "center": {"x": 0, "y": 0, "z": -0.12}}


def overlay_figure(overlay: Overlay) -> Figure:
    """Draw a pair before (source, target) and after (target, source as a method put it)."""
    scene = _scene(overlay.facts.unit)
    return {
        "data": [
            _cloud("source", BLUE, "scene"),
            _cloud("target", ORANGE, "scene"),
            {**_cloud("target", ORANGE, "scene2"), "showlegend": False},
            _cloud("source, registered", GREEN, "scene2"),
        ],
        "layout": _layout(
            scene={**scene, "domain": {"x": [0, 0.495], "y": [0, 1]}},
            scene2={**scene, "domain": {"x": [0.505, 1], "y": [0, 1]}},
        ),
    }


def walk_figure(unit: str) -> Figure:
    """Draw a walk back from noise: the target, and the source under two poses."""
    return {
        "data": [
            _cloud("target", ORANGE, "scene"),
            _cloud("source under the noisy pose G<sub>t</sub>", BLUE, "scene"),
            _cloud("source under the prediction of G<sub>0</sub>", GREEN, "scene"),
        ],
        "layout": _layout(scene=_scene(unit)),
    }


def _layout(**scenes: object) -> Figure:
    legend = {"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom", "itemsizing": "constant"}
    margin = {"l": 0, "r": 0, "t": 30, "b": 0}
    return layout(470, margin=margin, legend=legend, uirevision="kept", **scenes)


def _scene(unit: str) -> Figure:
    axes = {f"{name}axis": _space_axis(f"{name} [{unit}]") for name in "xyz"}
    return {**axes, "aspectmode": "data", "camera": CAMERA, "dragmode": "orbit"}


def _space_axis(label: str) -> Figure:
    return {
        "title": {"text": label, "font": {"size": 11}},
        "tickfont": {"size": 10},
        "nticks": 5,
        "color": "#55616D",
        "gridcolor": "#D5DBE1",
        "backgroundcolor": "white",
        "zeroline": False,
    }


def _cloud(name: str, color: str, scene: str) -> Figure:
    return {
        "type": "scatter3d",
        "mode": "markers",
        "name": name,
        "scene": scene,
        "marker": {"size": 2.2, "color": color, "opacity": 0.9},
        "hoverinfo": "name",
    }


def scene_data(
    overlays: Sequence[Overlay],
    walks: Mapping[str, Sequence[Walk]],
    walked: Mapping[str, Mapping[int, KnownPair]],
) -> dict[str, Any]:
    """Collect what the page moves: each cloud once, and poses as their twelve upper numbers.

    Returns:
        ``clouds`` by ``<scenario>/<pair>``, ``overlays`` and ``walks`` by scenario.
    """
    clouds = {
        f"{one.facts.scenario}/{one.pair}": _clouds(one.source, one.target)
        for overlay in overlays
        for one in overlay.choices.values()
    }
    for scenario, pairs in walked.items():
        for pair, known in pairs.items():
            clouds.setdefault(f"{scenario}/{pair}", _clouds(known.source, known.target))
    return {
        "clouds": clouds,
        "overlays": {overlay.facts.scenario: _choices(overlay) for overlay in overlays},
        "walks": {
            scenario: [_walk(walk, walked[scenario][walk.pair]) for walk in some]
            for scenario, some in walks.items()
            if scenario in walked
        },
    }


def _clouds(source: Cloud, target: Cloud) -> dict[str, list[list[float]]]:
    extent = float(np.ptp(target, axis=0).max()) or 1.0
    decimals = 3 - int(np.floor(np.log10(extent)))  # a thousandth of the cloud, as the eye sees
    return {
        name: np.round(thin(points), decimals).T.tolist()
        for name, points in (("source", source), ("target", target))
    }


def _choices(overlay: Overlay) -> dict[str, Any]:
    return {
        choice: {
            "pair": one.pair,
            "group": one.group,
            "poses": {
                registered.method: {
                    "pose": flat(registered.T_target_source),
                    "says": describe(registered, one.facts.unit),
                }
                for registered in one.registered
            },
        }
        for choice, one in overlay.choices.items()
    }


def _walk(walk: Walk, known: KnownPair) -> dict[str, Any]:
    return {
        "method": walk.method,
        "name": shown(walk.method).name,
        "pair": walk.pair,
        "group": known.group,
        "times": [*walk.times],
        **{
            name: [
                {"pose": flat(pose), "off": [*off]}
                for pose, off in zip(poses, errors(poses, known.T_target_source), strict=True)
            ]
            for name, poses in (("noisy", walk.noisy), ("predicted", walk.predicted))
        },
    }


def flat(pose: Pose) -> list[float]:
    """Write the upper three rows of a pose, row by row, to five decimals."""
    return [float(value) for value in np.round(pose[:3].ravel(), 5)]


def errors(estimates: Float64[np.ndarray, "steps 4 4"], truth: Pose) -> list[tuple[float, float]]:
    """Measure each pose: rotation error in degrees, translation error in the clouds' unit."""
    given = torch.from_numpy(np.ascontiguousarray(estimates))
    wanted = torch.from_numpy(truth).expand(len(given), 4, 4)
    off = zip(error_r_deg(given, wanted).tolist(), error_t(given, wanted).tolist(), strict=True)
    return [(float(f"{r:.3g}"), float(f"{t:.3g}")) for r, t in off]
