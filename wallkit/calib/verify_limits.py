"""Where `calib verify` draws its lines: every bound with its unit and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VerifyLimits:
    """Bounds of the gates; between a PASS and a FAIL bound nobody can tell.

    Attributes:
        board_px: median RMS of a board's pose in a picture, PASS and FAIL; correct intrinsics have 0.13 to 0.21 px on five
            real sets from 640 to 1920 px wide, wrong ones 0.88, so it does not scale with the width.
        plane_m, plane_sigmas: PASS of the RMS off the boards: the larger of so many metres and sigmas of a range.
        plane_bad_sigmas, plane_bad_m: FAIL: the smaller of both; a real LiDAR with the wrong intrinsics has 73 mm.
        view_ratio: FAIL of one view that a fresh solve could use, over the median view.
        trend_p, trend_bad_p, trend_m: CANNOT TELL and FAIL of a trend with distance or bearing that chance has once in 1/p;
            FAIL only where it is so large over the views, too, and half of it is no matter.
        bias_p: CANNOT TELL of a mean off the boards that chance has once in 1/p.
        pixel_px: 95 % error at the reference range, PASS, of an image `pixel_width` px wide; more is CANNOT TELL.
        reference_m: that range.
        edge_px, edge_bad_px: RMS over the views beside the plate's middle, PASS and FAIL, of an image that wide, and half
            a step between returns more.
        sigma_deg, sigma_mm, sigma_bad_deg, sigma_bad_mm: clustered sigma of the worst axis; a 2-D set whose boards did not
            fix it has 2.6 deg.
        urdf_p, urdf_bad_p, urdf_deg, urdf_mm: PASS above p, FAIL below the other p and beyond so much.
        power_deg, power_mm: a difference that the test must be able to see (80 %) before it may PASS.
        views, views_bad: PASS at or above; below the other no PASS whatever else holds. From 12 on, real sets are within
            0.4 deg and 11 mm of the answer of 40; with fewer than 5 up to 90 mm.
        hull: share of the image that the corners must span, of a camera alone.
        focal: sigma of the focal length over itself, of a camera alone.
        scale: how far squares may be from what was declared, or three sigmas.
        clock_s, clock_bad_s: offset beyond the calibration's, PASS and FAIL, where it is more than three sigmas.
        inliers: share of the sightings that agree; below it no PASS (9 of 16 were once sold as 4.6 px).
    """

    board_px: float = 0.4
    board_bad_px: float = 0.8
    plane_m: float = 0.010
    plane_sigmas: float = 1.5
    plane_bad_sigmas: float = 3.0
    plane_bad_m: float = 0.060
    view_ratio: float = 3.0
    trend_p: float = 0.01
    trend_bad_p: float = 0.001
    trend_m: float = 0.010
    bias_p: float = 0.01
    pixel_px: float = 5.0
    pixel_width: float = 1280.0
    reference_m: float = 3.0
    edge_px: float = 5.0
    edge_bad_px: float = 10.0
    sigma_deg: float = 0.5
    sigma_mm: float = 20.0
    sigma_bad_deg: float = 1.5
    sigma_bad_mm: float = 60.0
    urdf_p: float = 0.01
    urdf_bad_p: float = 1e-4
    urdf_deg: float = 0.2
    urdf_mm: float = 3.0
    power_deg: float = 0.5
    power_mm: float = 20.0
    views: int = 12
    views_bad: int = 5
    hull: float = 0.6
    focal: float = 0.005
    scale: float = 0.02
    clock_s: float = 0.020
    clock_bad_s: float = 0.050
    inliers: float = 0.8
