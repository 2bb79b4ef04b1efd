"""A Foxglove layout for result.mcap: map, particles and points in 3-D, errors and health as plots, the camera."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

_PLOT_COLOURS = ("#4e98e2", "#f5774d", "#f7df71", "#5cd6a9")
_SCENE = "3D!scene"
_ERROR, _HEALTH, _RATIOS = "Plot!error", "Plot!health", "Plot!ratios"
_CAMERA, _DIAGNOSTICS = "Image!camera", "DiagnosticSummary!health"


def write_layout(path: Path, *, cameras: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write the layout; Foxglove opens it by "Import from file"."""
    path.write_text(json.dumps(foxglove_layout(cameras=cameras), indent=1) + "\n", encoding="utf-8")


def foxglove_layout(*, cameras: Mapping[str, str] = MappingProxyType({})) -> dict[str, Any]:
    """The layout as Foxglove's JSON.

    Args:
        cameras: topic of a camera's images, where the result is played beside its log -> topic of its annotations.
    """
    configs: dict[str, Any] = {
        _SCENE: _scene(),
        _ERROR: _plot(
            "Error", {"position [m]": "/wallkit/error/position_m", "heading [rad]": "/wallkit/error/heading_rad"}
        ),
        _HEALTH: _plot("Health: 0 lost, 1 uncertain, 2 localized", {"state": "/wallkit/health/state"}),
        _RATIOS: _plot(
            "Beams on the map, before it, beyond it",
            {name: f"/wallkit/health/{name}" for name in ("hit_ratio", "short_ratio", "long_ratio")},
        ),
        _DIAGNOSTICS: {"topicToRender": "/wallkit/health", "minLevel": 0, "sortByLevel": True},
    }
    right: Any = _split(
        "column", _ERROR, _split("column", _HEALTH, _split("column", _RATIOS, _DIAGNOSTICS, 60), 33), 30
    )
    for number, (images, drawn) in enumerate(cameras.items()):
        panel = f"{_CAMERA}{number or ''}"
        shown = {drawn: {"visible": True}} if drawn else {}
        configs[panel] = {"imageMode": {"imageTopic": images, "annotations": shown}}
        right = _split("column", panel, right, 30)
    return {
        "configById": configs,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 5},
        "layout": _split("row", _SCENE, right, 65),
    }


def _scene() -> dict[str, Any]:
    points = {"visible": True, "pointSize": 5, "colorMode": "flat"}
    return {
        "followTf": "map",
        "followMode": "follow-none",
        "cameraState": {"perspective": False, "distance": 40, "phi": 0, "thetaOffset": 0},
        "topics": {
            "/wallkit/map": {"visible": True},
            "/wallkit/path": {"visible": True, "type": "line", "lineWidth": 0.05},
            "/wallkit/pose": {"visible": True, "showCovariance": True},
            "/ground_truth/pose": {"visible": True},
            "/wallkit/particles": {"visible": False},
            "/wallkit/particles/cloud": {
                "visible": True,
                "pointSize": 3,
                "colorMode": "colormap",
                "colorMap": "turbo",
                "colorField": "weight",
            },
            "/wallkit/scan/kept": {**points, "flatColor": "#00c853"},
            "/wallkit/scan/rejected": {**points, "flatColor": "#ff1744"},
            "/wallkit/filter/kept": {**points, "visible": False, "flatColor": "#00c853"},
            "/wallkit/filter/rejected": {**points, "visible": False, "flatColor": "#ff1744"},
        },
    }


def _plot(title: str, paths: dict[str, str]) -> dict[str, Any]:
    lines = [
        {"value": f"{path}.data", "label": label, "enabled": True, "timestampMethod": "receiveTime", "color": colour}
        for (label, path), colour in zip(paths.items(), _PLOT_COLOURS, strict=False)
    ]
    return {"title": title, "paths": lines, "showLegend": True, "xAxisVal": "timestamp", "isSynced": True}


def _split(direction: str, first: Any, second: Any, percentage: int) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
