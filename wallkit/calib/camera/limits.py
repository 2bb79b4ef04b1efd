"""Where `calib intrinsics` draws its lines: every bound with its unit and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.core.config import setting


@dataclass(frozen=True)
class CameraLimits:
    """The [calib.camera] table of wallkit.toml: bounds of the gates on a camera; short of a bound nobody can tell.

    Where the numbers come from. Views: from 12 on the intervals of 300 drawn captures hold the truth as often as they say.
    Rejected: a quarter is the most that is ever rejected, so a fit that used all of it may hide more. Held out: correct
    models have 0.13 to 0.21 px on five real sets from 640 to 1920 px wide, wrong ones 0.88, so it does not scale with the
    width. Focal: half a percent is 5 mm at 1 m, below what extrinsics are asked for. Pixel: of 40 views moved to the edges
    and corners with 0.1 px noise it is 0.10 to 0.15 px (a whole 9 x 6 chessboard) and 0.2 to 0.4 px (17 corners of a ChArUco
    board); with 0.2 px it is twice that. Halves: two cameras from every other view each differ by as much as the sum of
    their sigmas where these are honest, FAIL beyond twice that and so many pixels; they may differ by twice pixel_px, too,
    as half the views err sqrt(2) times as much as all. Half a pixel failed careful captures with 0.2 px noise (0.75 px); the
    pictures of two cameras taken for one have 1.9 px. Hull, cells: a 9 x 6 chessboard moved to the edges reaches 0.78 and
    1.0, a ChArUco board 0.97; one kept in the middle 0.3.
    """

    views: int = setting(12, "views of the board, PASS", low=3)
    rejected: float = setting(0.1, "share of the views that did not agree, PASS", low=0, high=1)
    rejected_bad: float = setting(0.24, "the same, FAIL", low=0, high=1)
    held_out_px: float = setting(0.4, "RMS on views that were held out, PASS", low=0)
    held_out_bad_px: float = setting(0.8, "the same, FAIL", low=0)
    focal: float = setting(0.005, "sigma of the focal length over itself, PASS", low=0)
    pixel_px: float = setting(
        0.5, "sigma of where a pixel looks, median over an image up to pixel_width wide, PASS", low=0
    )
    pixel_width: float = setting(1280.0, "width of the image [px] beyond which that bound grows", low=1)
    halves_sigmas: float = setting(2.0, "two cameras from every other view each, in sums of their sigmas, PASS", low=0)
    halves_bad_px: float = setting(2.0, "the same in px, FAIL", low=0)
    hull: float = setting(0.6, "share of the image that the corners span, PASS", low=0, high=1)
    cells: float = setting(0.6, "share of the image's 5 x 5 cells that hold a corner, PASS", low=0, high=1)
    tilted: int = setting(3, "views tilted by more than 25 deg about each axis, PASS", low=0)
    size_ratio: float = setting(1.5, "nearest by farthest board, PASS", low=1)
