"""The settings of calibration: where its verdicts draw the line."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.calib.camera.limits import CameraLimits
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.core.config import section


@dataclass(frozen=True)
class CalibSettings:
    """The [calib] table of wallkit.toml."""

    camera: CameraLimits = section(CameraLimits, "where `wallkit calib intrinsics` draws the line")
    verify: VerifyLimits = section(VerifyLimits, "where `wallkit calib verify` draws the line")
