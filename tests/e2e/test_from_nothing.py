"""Commands in an interpreter of their own: each imports what it uses, which a forked child that has it all cannot show."""

from __future__ import annotations

from pathlib import Path

import pytest

import wallkit.sample
from wallkit.segment.default import model_path

SAMPLE = Path(wallkit.sample.__file__).parent
LOG, MAP, CALIBRATION = SAMPLE / "log.mcap", SAMPLE / "floor.wkmap.urdf", SAMPLE / "camera.toml"

COMMANDS = {
    "doctor": (0, ["doctor"]),
    "log": (0, ["log", "info", LOG]),
    "map": (0, ["map", "validate", MAP]),
    "map export": (0, ["map", "export", MAP, "-o", "map.geojson"]),
    "calib": (4, ["calib", "verify", LOG, "--calib", CALIBRATION]),
    "model": (0, ["model", "inspect", model_path(Path("default"))]),
    "localize": (0, ["localize", LOG, "--map", MAP, "--filter", "wall_mask", "--calib", CALIBRATION, "-o", "run"]),
}


@pytest.mark.long
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_needs_no_other_to_have_been_imported(name, wallkit_from_nothing):
    code, words = COMMANDS[name]
    done = wallkit_from_nothing(*words)
    assert done.code == code, done.err
    assert "Traceback" not in done.err
    assert done.out
