"""The oracle's ceiling and a rendered picture agree, which fixes frame and handedness of both."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wallkit.core.ceiling import colours_at
from wallkit.core.ceiling_eye import CeilingEye, smoothed
from wallkit.pipelines.simulate.camera import render
from wallkit.pipelines.simulate.ceiling import true_ceiling
from wallkit.pipelines.simulate.log import LogRequest, prepare
from wallkit.pipelines.simulate.play import START_NS
from wallkit.simulate.scenario import read_scenario

MAP = Path(__file__).parents[2] / "maps" / "restroom.wkmap.urdf"
WORDS = ("duration_s=20", "crowd.walkers=0", "looks.ceiling=painted")
CAMERA = '[[cameras]]\nname = "up"\nwidth = 160\nheight = 120\n'


@pytest.mark.usefixtures("gl")
def test_a_rendered_picture_shows_the_true_ceiling_where_the_robot_is(tmp_path):
    (tmp_path / "up.toml").write_text(CAMERA)
    request = LogRequest(MAP, read_scenario(tmp_path / "up.toml", WORDS), seed=2)
    with contextlib.closing(prepare(request)) as play:
        ceiling = true_ceiling(play)
        assert ceiling is not None
        unit = play.unit("up")
        eye = CeilingEye(unit.published, unit.T_base_published, ceiling.height_m)
        soft = smoothed(ceiling, eye.smooth_m)
        off, off_when_mirrored = [], []
        for at_ns in (START_NS + 6_000_000_000, START_NS + 13_000_000_000):
            image = render(play, "up", at_ns, masks="none").image
            assert image is not None
            view, pose = eye.view(at_ns, image), play.pose_at(at_ns)
            for found, seen_by in ((off, view), (off_when_mirrored, replace(view, points_m=view.points_m * [1, -1]))):
                colours, known = colours_at(soft, pose, seen_by)
                a, b = view.colours.reshape(-1, 3)[known[0]], colours[0][known[0]]
                found.append(float(np.median(np.abs(a / (np.median(a, axis=0) / np.median(b, axis=0)) - b))))
    assert max(off) < 0.02
    assert min(off_when_mirrored) > 3 * max(off)
