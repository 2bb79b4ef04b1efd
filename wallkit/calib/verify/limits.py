"""Where `calib verify` draws its lines: every bound with its unit and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.core.config import setting


@dataclass(frozen=True)
class VerifyLimits:
    """The [calib.verify] table of wallkit.toml: bounds of the gates; between a PASS and a FAIL bound nobody can tell.

    `_bad` is FAIL, its fellow PASS. Where the numbers come from: correct intrinsics have 0.13 to 0.21 px on five real sets
    from 640 to 1920 px wide, wrong ones 0.88, so `board_px` does not scale with the width; a real LiDAR with the wrong
    intrinsics lies 73 mm off the boards; a 2-D set whose boards did not fix it has a sigma of 2.6 deg; 9 views of 16 were
    once sold as 4.6 px; from 12 views on, real sets are within 0.4 deg and 11 mm of the answer of 40, with fewer than 5 up
    to 90 mm.
    """

    board_px: float = setting(0.4, "median RMS of the corners of a board in a picture, PASS", low=0)
    board_bad_px: float = setting(0.8, "the same, FAIL", low=0)
    plane_m: float = setting(0.010, "RMS off the boards, PASS: this or the next, whichever is larger", low=0)
    plane_sigmas: float = setting(1.5, "the same in sigmas of a range", low=0)
    plane_bad_sigmas: float = setting(3.0, "RMS off the boards in sigmas of a range, FAIL", low=0)
    plane_bad_m: float = setting(0.060, "RMS off the boards, FAIL whatever the ranges scatter", low=0)
    view_ratio: float = setting(3.0, "RMS of the worst view over the median view, FAIL", low=1)
    trend_p: float = setting(0.01, "chance of a trend with distance or bearing, PASS above", low=0, high=1)
    trend_bad_p: float = setting(0.001, "the same, FAIL below", low=0, high=1)
    trend_m: float = setting(0.010, "a trend that matters, over the views; half of it is no matter", low=0)
    bias_p: float = setting(0.01, "chance of a mean off the boards, PASS above", low=0, high=1)
    pixel_px: float = setting(5.0, "95 % pixel error at the reference range, PASS, of an image pixel_width wide", low=0)
    pixel_width: float = setting(1280.0, "width of the image [px] that pixel bounds are for; they grow with it", low=1)
    reference_m: float = setting(3.0, "the reference range", low=0.1)
    edge_px: float = setting(5.0, "RMS beside the plate's middle, PASS, of an image pixel_width wide", low=0)
    edge_bad_px: float = setting(10.0, "the same, FAIL", low=0)
    sigma_deg: float = setting(0.5, "sigma of the worst turn, PASS", low=0)
    sigma_mm: float = setting(20.0, "sigma of the worst shift, PASS", low=0)
    sigma_bad_deg: float = setting(1.5, "sigma of the worst turn, FAIL", low=0)
    sigma_bad_mm: float = setting(60.0, "sigma of the worst shift, FAIL", low=0)
    urdf_p: float = setting(0.01, "chance of a difference from URDF, fresh solve or room, PASS above", low=0, high=1)
    urdf_bad_p: float = setting(1e-4, "the same, FAIL below where it matters", low=0, high=1)
    urdf_deg: float = setting(0.2, "a turn that matters", low=0)
    urdf_mm: float = setting(3.0, "a shift that matters", low=0)
    power_deg: float = setting(
        0.5, "a turn that the test against the URDF must have seen (80 %) before it may PASS", low=0
    )
    power_mm: float = setting(20.0, "a shift that it must have seen", low=0)
    views: int = setting(12, "views of the board, PASS", low=3)
    views_bad: int = setting(5, "fewer views: nothing is sure", low=1)
    hull: float = setting(0.6, "share of the image that the corners span, of a camera alone, PASS", low=0, high=1)
    focal: float = setting(0.005, "sigma of the focal length over itself, of a camera alone, PASS", low=0)
    scale: float = setting(0.02, "share by which squares may differ from what was declared, or three sigmas", low=0)
    clock_s: float = setting(0.020, "clock of the camera against the LiDAR's, or three sigmas, PASS", low=0)
    clock_bad_s: float = setting(0.050, "the same, FAIL", low=0)
    halves_p: float = setting(
        0.01, "chance of the difference between the halves of the views, PASS above", low=0, high=1
    )
    refit: float = setting(1.5, "error of the corners over that of a refit on views it has not seen, PASS", low=1)
    inliers: float = setting(0.8, "share of the sightings that agree, PASS", low=0, high=1)
