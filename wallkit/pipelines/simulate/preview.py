"""One moment of a play -> one picture for people: what every camera sees, what its pixels truly show, and the scan."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np

from wallkit.core.geometry import matrix_from_pose
from wallkit.core.types import Float64Array, Int64Array
from wallkit.pipelines.simulate.camera import render
from wallkit.pipelines.simulate.play import START_NS, Play
from wallkit.pipelines.simulate.sensors import LidarSensor, sensors_of
from wallkit.simulate.camera import Shot
from wallkit.simulate.meshes import corners_of
from wallkit.simulate.scene import NOTHING
from wallkit.simulate.world import MAP

_GREY = (0.55, 0.55, 0.55)
# wide enough for "dispenser" and its colour
_LEGEND_IN = 1.25


def preview(play: Play, time_s: float) -> bytes:
    """A PNG of a moment: a column for every camera, its picture over its mask; beside them the scan in the map.

    Raises:
        SimulationError: pictures are asked for and no OpenGL works.
    """
    from matplotlib.figure import Figure

    at_ns = START_NS + round(time_s * 1e9)
    setups = play.scenario.cameras
    shots = [render(play, setup.name, at_ns, masks="exact", pictures=setup.pictures) for setup in setups]
    figure = Figure(figsize=(3.6 * len(shots) + 5.6, 5.4), dpi=110, layout="constrained")
    grid = figure.add_gridspec(2, len(shots) + 1, width_ratios=[*(3.6 for _ in shots), 5.2])
    shown: set[int] = set()
    for column, (setup, shot) in enumerate(zip(setups, shots, strict=True)):
        shown |= _camera(figure, grid, column, setup.name, shot)
    shown |= _scan(figure.add_subplot(grid[:, -1]), play, at_ns)
    names = play.world.class_names
    figure.legend(
        handles=[_patch(names[k], _colour(k)) for k in sorted(shown)],
        loc="outside lower center",
        ncols=int(figure.get_figwidth() / _LEGEND_IN),
        frameon=False,
    )
    figure.suptitle(f"{play.world.name}, seed {play.seed}, at {time_s:.1f} of {play.duration_s:.1f} s", fontsize=11)
    file = BytesIO()
    figure.savefig(file, format="png", metadata={"Software": ""})
    return file.getvalue()


def _camera(figure: Any, grid: Any, column: int, name: str, shot: Shot) -> set[int]:
    """Draws one camera's column; the classes in it."""
    above, below = figure.add_subplot(grid[0, column]), figure.add_subplot(grid[1, column])
    for axes in (above, below):
        axes.set_xticks([])
        axes.set_yticks([])
    above.set_title(f"/camera/{name}", fontsize=9)
    if shot.image is not None:
        above.imshow(shot.image)
    else:
        above.text(0.5, 0.5, "no picture asked for", ha="center", va="center", transform=above.transAxes)
    below.imshow(_painted(shot.classes, shot.instances))
    below.set_title("what each pixel shows", fontsize=9)
    return set(np.unique(shot.classes[shot.classes >= 0]).tolist())


def _scan(axes: Any, play: Play, at_ns: int) -> set[int]:
    """Draws walls, people and the returns of one sweep, coloured by what they came from; the classes among them."""
    lidar = sensors_of(play)["lidar"]
    assert isinstance(lidar, LidarSensor)
    done = lidar.sweep(at_ns, at_ns)
    pose = play.pose_at(at_ns)
    T = matrix_from_pose(pose) @ play.robot.frames[lidar.frame]
    returned = np.isfinite(done.scan.ranges_m)
    ranges, bearings = done.scan.ranges_m[returned], done.scan.angles_rad[returned]
    local = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings), 0 * ranges, np.ones_like(ranges)])
    points = local @ T.T
    classes = play.scene.labels(done.solids[returned], play.scene.class_ids)
    for outline in _outlines(play):
        axes.fill(*outline.T, color="0.85", lw=0)
    axes.scatter(*points[:, :2].T, c=[_GREY if k == NOTHING else _colour(int(k)) for k in classes], s=4, lw=0)
    axes.annotate(
        "", xy=pose[:2] + 0.5 * np.array([np.cos(pose[2]), np.sin(pose[2])]), xytext=pose[:2],
        arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 1.5},
    )  # fmt: skip
    axes.plot(*pose[:2], "ko", ms=5)
    axes.set_aspect("equal")
    axes.set_title(f"/scan: {int(returned.sum())} returns of {len(returned)} beams", fontsize=9)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return {int(k) for k in np.unique(classes) if k != NOTHING}


def _outlines(play: Play) -> list[Float64Array]:
    """(C, 2) seen from above of every box and mesh that stands fast, but floor and ceiling."""
    import cv2

    found = []
    for solid in play.world.solids:
        if solid.kind in ("box", "mesh") and solid.body == MAP and solid.class_name not in ("floor", "ceiling"):
            corners = corners_of(solid) @ solid.T_body_solid.T
            hull = cv2.convexHull(corners[:, :2].astype(np.float32))
            found.append(np.asarray(hull[:, 0], dtype=np.float64))
    return found


def _painted(classes: Int64Array, instances: Int64Array) -> np.ndarray:
    """(H, W, 3) classes in their colours, things apart by their shade."""
    palette = np.array([_colour(k) for k in range(int(classes.max(initial=0)) + 1)] + [(0.0, 0.0, 0.0)])
    shade = 1 - 0.12 * (instances % 3)
    return np.asarray(palette[classes] * shade[..., None])


def _colour(class_id: int) -> tuple[float, float, float]:
    from matplotlib import colormaps

    r, g, b, _ = colormaps["tab20"](class_id % 20)
    return float(r), float(g), float(b)


def _patch(name: str, rgb: tuple[float, float, float]) -> Any:
    from matplotlib.patches import Patch

    return Patch(color=rgb, label=name)
