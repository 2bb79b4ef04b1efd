"""Particles at moments of a run -> a GIF, a film or a sheet: how the cloud gathers, over the map or over the ceiling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import compose, interpolate_poses, invert
from wallkit.core.types import Float64Array, OccupancyGrid, Trajectory, UInt8Array
from wallkit.errors import WallkitError
from wallkit.report.data import Snapshot

_WIDTH_PX = 720
# panels beside each other on a sheet, and the white between them
_COLUMNS, _GAP_PX = 3, 8
# a picture of a GIF stays so long, less where there are many
_MS, _SHORT_MS, _LAST_MS, _MANY = 900, 200, 3000, 20
_PICTURES_PER_S = 8
_PARTICLE, _TRUTH, _ESTIMATE, _INK = (0, 0, 0), (213, 94, 0), (0, 114, 178), (31, 41, 51)
_ARROW_PX = 16
_CAPTION_PX = 26


@dataclass(frozen=True, eq=False)
class Ground:
    """A picture to draw on: (H, W, 3) with +y up, the side of a pixel, and T_map_picture (3,) of its lower left corner."""

    pixels: UInt8Array
    pixel_m: float
    origin: Float64Array

    def place(self, poses: Float64Array) -> Float64Array:
        """(N, 3) column, row and heading on the picture of poses (N, 3) in frame map."""
        local = compose(invert(self.origin), poses)
        at = local[:, :2] / self.pixel_m
        return np.column_stack([at[:, 0], len(self.pixels) - at[:, 1], local[:, 2]])


def ground_of_grid(grid: OccupancyGrid) -> Ground:
    """The walls of a map on white."""
    shades = np.where(grid.cells < 0, 225, np.where(grid.cells > 50, 60, 255)).astype(np.uint8)
    return _scaled(np.repeat(shades[..., None], 3, axis=2), grid.resolution_m, grid.origin)


def ground_of_ceiling(ceiling: CeilingMap) -> Ground:
    """The ceiling, pale enough to draw on."""
    pixels = np.where(ceiling.is_seen[..., None], 110 + 0.57 * ceiling.pixels, 255).astype(np.uint8)
    return _scaled(pixels, ceiling.resolution_m, ceiling.origin)


def animation(ground: Ground, snapshots: Sequence[Snapshot], estimate: Trajectory, truth: Trajectory | None) -> bytes:
    """A GIF with one picture per snapshot: particles, where the robot is said to be, and where it was."""
    pictures = [_picture(ground, shot, estimate, truth).quantize(128) for shot in snapshots]
    file = BytesIO()
    times = [_MS if len(pictures) <= _MANY else _SHORT_MS] * (len(pictures) - 1) + [_LAST_MS]
    pictures[0].save(file, format="GIF", save_all=True, append_images=pictures[1:], duration=times, loop=0)
    return file.getvalue()


def film(ground: Ground, snapshots: Sequence[Snapshot], estimate: Trajectory, truth: Trajectory | None) -> bytes:
    """The same as an MP4 (H.264) of 8 pictures a second, the last of which stays for three.

    Raises:
        WallkitError: PyAV is not installed.
    """
    try:
        import av
    except ImportError as error:
        hint = "pip install 'wallkit[video]', or name a file that ends in .gif"
        raise WallkitError("an MP4 needs PyAV, which is not installed", where="--animate", hint=hint) from error
    file = BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream: Any = container.add_stream("libx264", rate=_PICTURES_PER_S, options={"crf": "20"})
        stream.width, stream.height, stream.pix_fmt = *_even(ground), "yuv420p"
        held = _PICTURES_PER_S * _LAST_MS // 1000
        for shot in [*snapshots, *[snapshots[-1]] * (held - 1)]:
            picture = _picture(ground, shot, estimate, truth).crop((0, 0, stream.width, stream.height))
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")))
        container.mux(stream.encode())
    return file.getvalue()


def sheet(ground: Ground, snapshots: Sequence[Snapshot], estimate: Trajectory, truth: Trajectory | None) -> bytes:
    """The same moments as one PNG, three in a row, to be read like a page."""
    from PIL import Image

    pictures = [_picture(ground, shot, estimate, truth) for shot in snapshots]
    columns = min(len(pictures), _COLUMNS)
    width, height = (side + _GAP_PX for side in pictures[0].size)
    whole = Image.new("RGB", (columns * width - _GAP_PX, -(-len(pictures) // columns) * height - _GAP_PX), "white")
    for number, picture in enumerate(pictures):
        whole.paste(picture, (number % columns * width, number // columns * height))
    file = BytesIO()
    whole.save(file, format="PNG", optimize=True)
    return file.getvalue()


def _even(ground: Ground) -> tuple[int, int]:
    """Width and height of a picture as H.264 takes them."""
    height, width = ground.pixels.shape[:2]
    return width // 2 * 2, (height + _CAPTION_PX) // 2 * 2


def _picture(ground: Ground, shot: Snapshot, estimate: Trajectory, truth: Trajectory | None) -> Any:
    from PIL import Image, ImageDraw

    height, width = ground.pixels.shape[:2]
    image = Image.new("RGB", (width, height + _CAPTION_PX), "white")
    image.paste(Image.fromarray(ground.pixels), (0, 0))
    draw = ImageDraw.Draw(image)
    for x, y, _ in ground.place(shot.poses).tolist():
        draw.rectangle((x - 0.5, y - 0.5, x + 0.5, y + 0.5), fill=_PARTICLE)
    said = interpolate_poses(estimate.stamps_ns, estimate.poses, [shot.stamp_ns])
    _arrow(draw, ground.place(said)[0], _ESTIMATE)
    if truth is not None:
        _arrow(draw, ground.place(interpolate_poses(truth.stamps_ns, truth.poses, [shot.stamp_ns]))[0], _TRUTH)
    seconds = (shot.stamp_ns - int(estimate.stamps_ns[0])) / 1e9
    draw.rectangle((0, height, width, height + _CAPTION_PX), fill="white")
    draw.text((6, height + 6), f"{seconds:6.1f} s  {shot.label}", fill=_INK)
    draw.text((width - 190, height + 6), "estimate", fill=_ESTIMATE)
    if truth is not None:
        draw.text((width - 100, height + 6), "truth", fill=_TRUTH)
    return image


def _arrow(draw: Any, at: Float64Array, colour: tuple[int, int, int]) -> None:
    x, y, heading = at.tolist()
    tip = (x + _ARROW_PX * np.cos(heading), y - _ARROW_PX * np.sin(heading))
    draw.ellipse((x - 6, y - 6, x + 6, y + 6), outline=colour, width=3)
    draw.line((x, y, *tip), fill=colour, width=3)


def _scaled(rows_up: UInt8Array, side_m: float, origin: Float64Array) -> Ground:
    """The picture at the animation's width, its row 0 at the top."""
    from PIL import Image

    height, width = rows_up.shape[:2]
    factor = _WIDTH_PX / width
    size = (_WIDTH_PX, max(1, round(height * factor)))
    scaled = Image.fromarray(np.ascontiguousarray(rows_up[::-1])).resize(size, Image.Resampling.BILINEAR)
    return Ground(np.asarray(scaled, dtype=np.uint8), side_m / factor, origin)
