"""UTM easting and northing -> longitude and latitude on WGS84."""

from __future__ import annotations

import math

import numpy as np

from wallkit.core.types import Float64Array

# WGS84: semi-major axis [m], flattening; UTM: scale on the central meridian, false easting, false northing of the south
_A, _F = 6378137.0, 1 / 298.257223563
_K0, _EAST_M, _SOUTH_M = 0.9996, 500_000.0, 10_000_000.0


def utm_zone(epsg: int | None) -> tuple[int, bool] | None:
    """(zone, is_north) of an EPSG code of WGS84 / UTM (326zz, 327zz), else None."""
    if epsg is None or epsg // 100 not in (326, 327) or not 1 <= epsg % 100 <= 60:
        return None
    return epsg % 100, epsg // 100 == 326


def lonlat_from_utm(points_m: Float64Array, epsg: int) -> Float64Array:
    """Longitude and latitude (K, 2) [deg] of easting and northing (K, 2) [m].

    Krueger's series to the fourth order in the third flattening (Karney 2011, J. Geodesy 85, eqs. 11-20, 36): a micrometre
    anywhere in a zone.

    Raises:
        ValueError: the code is no zone of WGS84 / UTM.
    """
    zone = utm_zone(epsg)
    if zone is None:
        raise ValueError(f"EPSG:{epsg} is no zone of WGS84 / UTM")
    n = _F / (2 - _F)
    radius = _A / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    beta = (
        n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96 - n**4 / 360,
        n**2 / 48 + n**3 / 15 - 437 * n**4 / 1440,
        17 * n**3 / 480 - 37 * n**4 / 840,
        4397 * n**4 / 161280,
    )
    xi = (points_m[:, 1] - (0.0 if zone[1] else _SOUTH_M)) / (_K0 * radius)
    eta = (points_m[:, 0] - _EAST_M) / (_K0 * radius)
    turns = range(1, len(beta) + 1)
    xi_0 = xi - sum(b * np.sin(2 * j * xi) * np.cosh(2 * j * eta) for j, b in zip(turns, beta, strict=True))
    eta_0 = eta - sum(b * np.cos(2 * j * xi) * np.sinh(2 * j * eta) for j, b in zip(turns, beta, strict=True))
    tau_conformal = np.sin(xi_0) / np.hypot(np.sinh(eta_0), np.cos(xi_0))
    longitude = np.arctan2(np.sinh(eta_0), np.cos(xi_0))
    latitude = np.arctan(_tau_from_conformal(np.asarray(tau_conformal)))
    return np.column_stack([np.degrees(longitude) + 6 * zone[0] - 183, np.degrees(latitude)])


def _tau_from_conformal(conformal: Float64Array) -> Float64Array:
    """Tangent of the latitude from that of the conformal latitude, by Newton's method (Karney 2011, eqs. 7-9, 19-21)."""
    e = math.sqrt(_F * (2 - _F))
    tau = conformal.copy()
    for _ in range(5):
        sigma = np.sinh(e * np.arctanh(e * tau / np.hypot(1, tau)))
        guess = tau * np.hypot(1, sigma) - sigma * np.hypot(1, tau)
        slope = (1 + (1 - e**2) * tau**2) / ((1 - e**2) * np.hypot(1, tau))
        tau = tau + (conformal - guess) / np.hypot(1, guess) * slope
    return tau
