"""map_server YAML + image: Nav2's rules, pixel by pixel, and one clear message for everything wrong."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.grids.raster import read_raster

GOOD = {
    "image": "map.png",
    "resolution": "0.05",
    "origin": "[1.0, -2.0, 0.5]",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def write(folder, pixels=None, **changes):
    """A YAML with some keys changed (None leaves one out), and its image."""
    if pixels is not None:
        cv2.imwrite(str(folder / "map.png"), np.asarray(pixels, dtype=np.uint8))
    lines = [f"{key}: {value}" for key, value in {**GOOD, **changes}.items() if value is not None]
    path = folder / "map.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_trinary_by_thresholds_and_bottom_row_first(tmp_path):
    grid, findings = read_raster(write(tmp_path, [[0, 254, 205], [89, 90, 206]]))
    # occupancy (255 - v) / 255: 89 is 0.651 (occupied), 90 is 0.647 (unknown), 205 is 0.1961 (unknown), 206 free
    np.testing.assert_array_equal(grid.cells, [[100, -1, 0], [100, 0, -1]])
    assert grid.resolution_m == 0.05
    np.testing.assert_array_equal(grid.origin, [1.0, -2.0, 0.5])
    assert [f.code for f in findings] == ["WK-R004"]


def test_negate_turns_black_into_free(tmp_path):
    grid, _ = read_raster(write(tmp_path, [[0, 255]], negate="1"))
    np.testing.assert_array_equal(grid.cells, [[0, 100]])


def test_scale_spreads_what_lies_between_the_thresholds(tmp_path):
    grid, _ = read_raster(write(tmp_path, [[0, 255, 128, 150]], mode="scale"))
    occupancy = (255 - np.array([128, 150])) / 255
    np.testing.assert_array_equal(grid.cells, [[100, 0, *np.rint((occupancy - 0.196) / (0.65 - 0.196) * 100)]])


def test_scale_takes_transparent_pixels_for_unknown_and_trinary_for_brighter(tmp_path):
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[0, :, 3] = (255, 0)
    np.testing.assert_array_equal(read_raster(write(tmp_path, pixels, mode="scale"))[0].cells, [[100, -1]])
    # Nav2 averages alpha in: (0 + 0 + 0 + 255) / 4 = 64 is still dark
    np.testing.assert_array_equal(read_raster(write(tmp_path, pixels))[0].cells, [[100, 100]])


def test_raw_is_taken_as_it_is(tmp_path):
    grid, _ = read_raster(write(tmp_path, [[0, 37, 100, 101, 255]], mode="raw"))
    np.testing.assert_array_equal(grid.cells, [[0, 37, 100, -1, -1]])


def test_colour_images_count_by_their_mean(tmp_path):
    pixels = np.array([[[0, 0, 0], [255, 255, 255], [0, 0, 255]]], np.uint8)
    np.testing.assert_array_equal(read_raster(write(tmp_path, pixels))[0].cells, [[100, 0, 100]])


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        ({"resolution": "-0.05"}, 2, "not a length above 0"),
        ({"resolution": ".nan"}, 2, "not a length above 0"),
        ({"resolution": "five"}, 2, "'five'"),
        ({"resolution": None}, 1, "'resolution' is missing"),
        ({"origin": "[1, 2]"}, 3, r"origin is \[1, 2\]"),
        ({"origin": "[1, 2, up]"}, 3, "three numbers"),
        ({"mode": "trinray"}, 6, "did you mean 'trinary'"),
        ({"occupied_thresh": "0.1"}, 4, "not above free_thresh"),
        ({"free_thresh": "7"}, 5, "between 0 and 1"),
        ({"image": "gone.png"}, 1, "not beside the YAML"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(tmp_path, change, line, words):
    path = write(tmp_path, [[0, 255]], **change)
    with pytest.raises(MapError, match=words) as caught:
        read_raster(path)
    assert caught.value.where == f"{path}:{line}"
    assert caught.value.hint


@pytest.mark.parametrize("text", ["", "just words", "[1, 2]", "a: [", "image: map.png\nimage: other.png\n"])
def test_no_yaml_at_all_is_one_message(tmp_path, text):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(MapError):
        read_raster(path)


def test_a_damaged_image_is_one_message(tmp_path):
    path = write(tmp_path, [[0, 255]])
    (tmp_path / "map.png").write_bytes(b"\x89PNG but not really")
    with pytest.raises(MapError, match="cannot be decoded"):
        read_raster(path)


def test_unknown_that_turns_free_is_reported(tmp_path):
    _, findings = read_raster(write(tmp_path, [[205, 205, 0, 254]], free_thresh="0.25", origin="[0, 0, 0]"))
    (finding,) = findings
    assert finding.code == "WK-R002"
    assert finding.detail["cells"] == 2
    assert finding.line == 5


def test_the_real_traps(data):
    maps = data / "maps" / "pgm"
    _, findings = read_raster(maps / "depot.yaml")
    assert [(f.code, f.detail.get("cells")) for f in findings] == [("WK-R002", 8894)]
    with pytest.raises(MapError, match="not beside the YAML") as caught:
        read_raster(maps / "invalid_image.yaml")
    assert caught.value.where.endswith("invalid_image.yaml:1")
    for name in ("map", "tb3_sandbox", "willow-2010-02-18-0.10"):
        grid, findings = read_raster(maps / f"{name}.yaml")
        assert set(np.unique(grid.cells)) == {-1, 0, 100}
        assert not findings


def test_the_map_turned_by_pi_keeps_its_origin(data):
    grid, _ = read_raster(data / "logs" / "mit_rss" / "stata_basement.yaml")
    np.testing.assert_array_equal(grid.origin, [25.9, 48.5, 3.14])
