"""Where `calib intrinsics` draws its lines: every bound with its unit and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraLimits:
    """Bounds of the gates on a camera; short of a bound nobody can tell, beyond a bad one it is FAIL.

    Attributes:
        views: PASS at or above. From 12 on the intervals of 300 drawn captures hold the truth as often as they say.
        rejected, rejected_bad: share of the views that did not agree. A quarter is the most that is ever rejected, so a fit
            that used all of it may hide more.
        held_out_px, held_out_bad_px: RMS on views that were held out. Correct models have 0.13 to 0.21 px on five real sets
            from 640 to 1920 px wide, wrong ones 0.88, so it does not scale with the width.
        focal: sigma of the focal length over itself: half a percent is 5 mm at 1 m, below what extrinsics are asked for.
        pixel_px: sigma of where a pixel looks, median over the image, of one `pixel_width` px wide or less, in proportion
            beyond. Of 40 views moved to the edges and corners with 0.1 px noise it is 0.10 to 0.15 px (a whole 9 x 6
            chessboard) and 0.2 to 0.4 px (17 corners of a ChArUco board); with 0.2 px it is twice that.
        halves_sigmas, halves_bad_px: two cameras from every other view each differ by as much as the sum of their sigmas
            where these are honest; FAIL beyond twice that and so many pixels. They may differ by twice pixel_px, too: half
            the views err sqrt(2) times as much as all, so their difference is twice as uncertain as the result. Half a pixel
            failed careful captures with 0.2 px noise (0.75 px); the pictures of two cameras taken for one have 1.9 px.
        hull, cells: shares of the image that the corners span and of its 5 x 5 cells that hold one. A 9 x 6 chessboard
            moved to the edges reaches 0.78 and 1.0, a ChArUco board 0.97; one kept in the middle 0.3.
        tilted: views tilted by more than 25 deg about each axis; without, focal length and distance are the same.
        size_ratio: nearest by farthest board.
    """

    views: int = 12
    rejected: float = 0.1
    rejected_bad: float = 0.24
    held_out_px: float = 0.4
    held_out_bad_px: float = 0.8
    focal: float = 0.005
    pixel_px: float = 0.5
    pixel_width: float = 1280.0
    halves_sigmas: float = 2.0
    halves_bad_px: float = 2.0
    hull: float = 0.6
    cells: float = 0.6
    tilted: int = 3
    size_ratio: float = 1.5
