from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.ceilings import painted
from wallkit.errors import MapError
from wallkit.maps.ceiling.files import ceiling_files, read_ceiling


def written(folder, ceiling):
    text, png = ceiling_files(ceiling, "ceiling.png")
    (folder / "ceiling.yaml").write_bytes(text)
    (folder / "ceiling.png").write_bytes(png)
    return folder / "ceiling.yaml"


def test_a_ceiling_comes_back_as_it_was_written(tmp_path):
    seen = np.ones((300, 400), bool)
    seen[:40, 300:] = False
    ceiling = replace(painted(origin=(-1.0, 2.5, 0.3)), is_seen=seen)
    again = read_ceiling(written(tmp_path, ceiling))
    np.testing.assert_array_equal(again.is_seen, seen)
    np.testing.assert_array_equal(again.pixels[seen], ceiling.pixels[seen])
    np.testing.assert_allclose(again.origin, ceiling.origin)
    assert (again.resolution_m, again.height_m) == (0.02, 2.7)


def test_the_picture_lies_over_the_plan(tmp_path):
    """A red mark in the map's upper right corner is in the PNG's upper right corner."""
    import cv2

    ceiling = painted()
    ceiling.pixels[-20:, -20:] = (255, 0, 0)
    written(tmp_path, ceiling)
    picture = cv2.imread(str(tmp_path / "ceiling.png"))
    assert picture[5, -5].tolist() == [0, 0, 255]
    cells, seen = read_ceiling(tmp_path / "ceiling.yaml").cells_at(np.array([6.95, 7.95]))
    assert seen
    assert ceiling.pixels[tuple(cells)].tolist() == [255, 0, 0]


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("image: ceiling.png\n", ":1:", r"resolution.*missing.*(\n.*)*ceiling fit LOG --picture"),
        ("image: ceiling.png\nresolution: -1\n", ":2:", "-1, not a length"),
        ("image: ceiling.png\nresolution: 0.02\norigin: [0, 1]\n", ":3:", "three numbers"),
        ("image: ceiling.png\nresolution: 0.02\nheight: tall\n", ":3:", "height is 'tall'"),
        ("resolution: 0.02\n", ":1:", "'image' is missing"),
        ("image: other.png\nresolution: 0.02\n", ":1:", "no picture"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, text, place, message):
    path = written(tmp_path, painted())
    path.write_text(text)
    with pytest.raises(MapError, match=message) as caught:
        read_ceiling(path)
    assert place in str(caught.value)


def test_a_bare_picture_is_sent_to_fit(tmp_path):
    written(tmp_path, painted())
    with pytest.raises(MapError, match=r"no resolution.*(\n.*)*wallkit ceiling fit"):
        read_ceiling(tmp_path / "ceiling.png")
