"""How far the ranges of common LiDARs scatter, by their data sheets; for those who did not measure their own."""

from __future__ import annotations

from wallkit.errors import CalibrationError, closest

ASSUMED_M = 0.02

# name -> (sigma of a range [m] indoors, what the data sheet says)
LIDARS: dict[str, tuple[float, str]] = {
    "lds-01": (0.010, "LDS-01: precision +-10 mm from 0.12 to 0.5 m"),
    "lms111": (0.012, "SICK LMS111: statistical error 12 mm"),
    "urg-04lx": (0.010, "Hokuyo URG-04LX: +-10 mm up to 1 m"),
    "utm-30lx": (0.030, "Hokuyo UTM-30LX: +-30 mm up to 10 m"),
    "vlp-16": (0.030, "Velodyne VLP-16: +-3 cm, typical"),
}


def sigma_range(words: str | None) -> tuple[float, str]:
    """(sigma [m], where it comes from) of "15mm", "0.015" (metres) or a LiDAR's name; an assumption when nothing is said.

    Raises:
        CalibrationError: neither.
    """
    if words is None:
        return ASSUMED_M, "assumed"
    name = words.lower()
    if name in LIDARS:
        return LIDARS[name]
    number = name.removesuffix("mm").removesuffix("cm") if name.endswith(("mm", "cm")) else name.removesuffix("m")
    unit = 1e-3 if name.endswith("mm") else 1e-2 if name.endswith("cm") else 1.0
    try:
        value = float(number) * unit
    except ValueError as error:
        raise CalibrationError(
            f"--sigma-range '{words}' is neither a length nor a LiDAR", hint=closest(name, LIDARS)
        ) from error
    if not 1e-4 < value < 0.5:
        raise CalibrationError(f"--sigma-range {value:g} m is not between 0.1 mm and 0.5 m", hint="write 15mm or 0.015")
    return value, "declared"
