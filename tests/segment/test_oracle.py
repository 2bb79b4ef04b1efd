"""The colour oracle on drawn pictures, in every layout and many sizes: what was drawn is found where it was drawn."""

from __future__ import annotations

import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, picture
from wallkit.segment.layouts import LAYOUTS
from wallkit.segment.settings import SegmentSettings

SIZES = [(480, 640), (720, 1280), (530, 730), (333, 517), (640, 480), (1231, 1640)]


def edges_along(segmentation, name: str, start: tuple[float, float], step: tuple[float, float], count: int):
    """First and last place along a line where a class is seen, in steps."""
    line = np.array(start) + np.arange(count)[:, None] * np.array(step)
    labels, _ = segmentation.classes_at(line)
    (found,) = np.nonzero(labels == segmentation.names.index(name))
    return found[0], found[-1]


@pytest.mark.parametrize("layout", LAYOUTS)
class TestContract:
    """What every layout keeps."""

    @pytest.fixture
    def segmenter(self, layout, tmp_path):
        return colour_oracle(tmp_path, layout=layout)

    def test_the_layout_is_read_from_the_file(self, layout, segmenter):
        assert segmenter.layout == layout
        assert segmenter.size == (320, 320)
        assert segmenter.names == ("wall", "door", "toilet", "urinal", "sink", "person", "background")
        assert segmenter.roles == segmenter.names

    @pytest.mark.parametrize("shape", SIZES)
    def test_middles_are_where_they_were_drawn_to_a_quarter_cell(self, segmenter, shape):
        """Both edges of a thing are off by the same, so its middle is exact, up to the grid of half or a quarter size."""
        height, width = shape
        left, right, top, bottom = (
            round(f * side) for f, side in ((0.2, width), (0.61, width), (0.3, height), (0.83, height))
        )
        found = segmenter.segment(picture(shape, {"wall": (left, top, right, bottom)}))
        middle = (left + right - 1) / 2, (top + bottom - 1) / 2
        first, last = edges_along(found, "wall", (0, middle[1]), (0.1, 0), 10 * width)
        # between cells scores are bilinear, ids are not
        cell = max(shape) / 320 * {"class-scores": 2, "class-ids": 4}.get(segmenter.layout, 4)
        assert abs((first + last) / 20 - middle[0]) < cell / 4
        first, last = edges_along(found, "wall", (middle[0], 0), (0, 0.1), 10 * height)
        assert abs((first + last) / 20 - middle[1]) < cell / 4

    def test_look_up_labels_mask_and_polygons_agree(self, segmenter):
        found = segmenter.segment(picture((240, 320), {"wall": (20, 40, 300, 220), "person": (100, 60, 160, 240)}))
        u, v = np.meshgrid(np.arange(320), np.arange(240))
        labels, confidences = found.classes_at(np.stack([u.ravel(), v.ravel()], axis=1))
        same = labels.reshape(240, 320) == found.labels()
        # a sum of 0 to the last bit may fall on either side
        assert same.mean() > 0.9999
        assert confidences.min() > 0
        assert confidences.max() <= 1
        counts = np.array(found.roles)[found.labels()]
        np.testing.assert_array_equal(found.mask({"wall"}), counts == "wall")
        assert {found.roles[p.label] for p in found.polygons()} == {"wall", "person"}
        assert all(0 < p.confidence <= 1 for p in found.polygons())

    def test_pixels_beside_the_image_have_no_class(self, segmenter):
        found = segmenter.segment(picture((240, 320), {"wall": (0, 0, 320, 240)}))
        labels, confidences = found.classes_at([[-0.6, 10], [319.6, 10], [10, -1], [10, 240], [np.nan, 5], [5, 5]])
        np.testing.assert_array_equal(labels, [-1, -1, -1, -1, -1, 0])
        np.testing.assert_array_equal(confidences[:5], 0)

    def test_no_points_and_an_empty_picture(self, segmenter):
        found = segmenter.segment(picture((240, 320), {}))
        labels, _ = found.classes_at(np.zeros((0, 2)))
        assert labels.shape == (0,)
        assert {found.roles[label] for label in np.unique(found.labels())} == {"background"}
        assert found.polygons() == []

    def test_names_that_do_not_fit_the_outputs_are_refused(self, layout, tmp_path):
        import onnx

        from wallkit.errors import ModelError
        from wallkit.segment.onnx_segmenter import load_segmenter

        path = colour_oracle(tmp_path, layout=layout).model.path
        model = onnx.load(path)
        onnx.helper.set_model_props(model, {"names": "{0: 'wall', 1: 'door'}"})
        onnx.save(model, path)
        if layout in ("yolo-rows", "class-ids"):
            # nothing in the shapes says how many classes there are
            segmenter = load_segmenter(path)
            rgb = picture((240, 320), {"sink": (0, 0, 320, 240)})
            if layout == "yolo-rows":
                with pytest.raises(ModelError, match=r"class 4, but has 2 names"):
                    segmenter.segment(rgb)
            else:
                assert (segmenter.segment(rgb).labels() == -1).all()
            return
        with pytest.raises(ModelError, match="names 2 classes"):
            load_segmenter(path)


def test_what_is_less_sure_than_asked_is_not_found(tmp_path):
    """14 cells of 6,400 are a share of 0.0021875; the oracle is sigmoid(4000 * (share - 0.002)) = 0.68 sure of it."""
    rgb = picture((320, 320), {"wall": (0, 0, 200, 200), "sink": (256, 256, 264, 284)})
    for asked, classes in ((0.5, {0, 4}), (0.8, {0})):
        segmenter = colour_oracle(tmp_path, settings=SegmentSettings(min_score=asked))
        found = segmenter.segment(rgb).detections
        assert set(found.labels.tolist()) == classes
    assert asked > 1 / (1 + np.exp(-0.75)) > 0.5


def test_confidence_is_score_times_sigmoid_and_the_background_what_is_left(tmp_path):
    found = colour_oracle(tmp_path).segment(picture((320, 320), {"wall": (0, 0, 160, 320)}))
    labels, sure = found.classes_at([[40, 100], [280, 100]])
    assert [found.names[label] for label in labels] == ["wall", "background"]
    score = found.detections.scores[0]
    # the wall's own colour: a sum of gain * margin = 8; the other: far below 0
    assert sure[0] == pytest.approx(score / (1 + np.exp(-8)), rel=1e-3)
    assert sure[1] > 0.99
