"""Class lists of models: every way to write one, ONNX metadata, and refusals that say what was found."""

from __future__ import annotations

import json

import pytest

from tests.maps.drawn import box, placed, robot
from wallkit.errors import MapError
from wallkit.maps.labels import read_labels
from wallkit.maps.rules import validate

WALL_DOOR = {0: "wall", 1: "door"}


@pytest.mark.parametrize(
    ("name", "text", "labels"),
    [
        ("a.txt", "wall\ndoor\n\n", WALL_DOOR),
        ("a.txt", "\ufeffwall\r\ndoor", WALL_DOOR),
        ("a.names", "wall\ndoor", WALL_DOOR),
        ("a.json", '["wall", "door"]', WALL_DOOR),
        ("a.json", '{"names": {"3": "wall", "7": "door"}}', {3: "wall", 7: "door"}),
        ("a.yaml", "names:\n  0: wall\n  1: door\nnc: 2\n", WALL_DOOR),
        ("a.yaml", "- wall\n- door\n", WALL_DOOR),
        ("a.yml", "names: [wall, door]\n", WALL_DOOR),
    ],
)
def test_a_list_of_classes_is_read_however_it_is_written(tmp_path, name, text, labels):
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert read_labels(tmp_path / name) == labels


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.txt", b"", "there are no classes in it"),
        ("a.txt", b"wall\n\ndoor\n", "class 1 is ''"),
        ("a.txt", b"\xff\xfe\0", "no text"),
        ("a.txt", b"<robot name='t'/>", "class 0 is"),
        ("a.json", b"{", "not valid JSON"),
        ("a.json", b'{"nc": 2}', "class 'nc' is '2'"),
        ("a.json", b'{"names": 3}', "there are no classes"),
        ("a.yaml", b"names: {wall: 0}", "class 'wall' is '0'"),
        ("a.yaml", b"names: [\n", "not valid YAML"),
        ("a.onnx", b"no model", "cannot be loaded"),
        ("none.onnx", None, "no such file"),
        ("none.txt", None, "cannot read the labels"),
    ],
)
def test_what_is_no_list_of_classes_is_refused_in_one_line(tmp_path, name, data, said):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(MapError, match=said) as raised:
        read_labels(tmp_path / name)
    assert name in raised.value.where
    assert raised.value.hint
    assert "\n" not in raised.value.message


@pytest.mark.data
def test_a_model_says_its_classes_in_its_metadata_or_is_refused(data):
    assert read_labels(data / "yolo/weights/wallseg_yolov8n_320.onnx") == dict(
        enumerate(["wall", "door", "floor", "toilet", "sink"])
    )
    with pytest.raises(MapError, match="has no 'names'"):
        read_labels(data / "yolo/weights/deeplabv3_mnv2_ade20k_257.onnx")


# ------------------------------------------------------------------------------------------------ the rules on them

TABLE = '<wk:map format="1.0" units="m rad">{}</wk:map>'
THINGS = [box("w", "4 0.1 2.5"), placed("w", "0 0 0"), box("s", "0.4 0.4 0.2", wk_class="sink"), placed("s", "0 1 0")]


def findings(*rows, labels, **options):
    report = validate(robot(TABLE.format("".join(rows)), *THINGS), select=["C"], labels=labels, **options)
    return {(f.code, f.message.split("'")[1]) for f in report.findings if f.code in ("WK-C004", "WK-C008")}


def test_without_labels_nothing_is_asked():
    assert findings(labels=None) == set()


def test_classes_go_by_name_or_by_their_ids():
    assert findings(labels={0: "wall", 1: "sink"}) == set()
    assert findings(labels={0: "wall"}) == {("WK-C004", "sink")}
    by_id = '<wk:class name="sink" seg="7"/>'
    assert findings(by_id, labels={0: "wall", 7: "lavabo"}) == set()
    assert findings(by_id, labels={0: "wall", 1: "lavabo"}) == {("WK-C008", "sink")}
    # the id means another label than its own name
    assert findings(by_id, labels={0: "wall", 7: "door", 8: "sink"}) == {("WK-C004", "sink")}


def test_labels_that_nothing_has_are_told_in_one_finding():
    labels = {0: "wall", 1: "sink", 2: "sofa", 3: "cat"}
    report = validate(robot(TABLE.format(""), *THINGS), select=["C"], labels=labels)
    (finding,) = (f for f in report.findings if f.code == "WK-C006")
    assert finding.detail["labels"] == ["sofa", "cat"]
    assert finding.severity == "info"


def test_a_map_may_name_its_labels_but_only_beside_itself(tmp_path):
    (tmp_path / "labels.json").write_text(json.dumps(["wall"]))
    for name, said in (
        ("labels.json", "class 'sink' is none of the model's 1 labels"),
        ("none.json", "labels 'none.json': cannot read the labels"),
        ("../labels.json", "labels '../labels.json': leaves the map's folder"),
        ("/etc/passwd", "labels '/etc/passwd': absolute path"),
    ):
        data = robot(f'<wk:check labels="{name}"/>', TABLE.format(""), *THINGS)
        report = validate(data, select=["C"], source=str(tmp_path / "m.urdf"))
        assert [f.message.startswith(said) for f in report.findings if f.code == "WK-C004"] == [True], name
    # what is given beats what the map says
    given = validate(data, select=["C"], source=str(tmp_path / "m.urdf"), labels={0: "wall", 1: "sink"})
    assert given.findings == ()
