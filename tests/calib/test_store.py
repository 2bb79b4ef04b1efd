"""Every format gives back what it holds, to the last bit, and says what it cannot hold."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.files.store import FORMATS, read_calibration, text_from_calibration
from wallkit.core.calibration import Calibration, Provenance
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError

K = np.array([[612.123456789012, 0, 319.1], [0, 605.3, 244.2], [0, 0, 1]])
DISTORTIONS = {
    "plumb_bob": [-0.28, 0.11, 0.0011, -0.0007, 0.0],
    "rational_polynomial": [0.35, -0.08, 0.0011, -0.0007, 0.012, 0.66, -0.05, 0.03],
    "equidistant": [-0.04, 0.012, -0.008, 1 / 3],
}


def camera(model: str) -> Camera:
    return Camera(model, 640, 480, K, np.array(DISTORTIONS[model]), name="front")


def whole(model: str) -> Calibration:
    rng = np.random.default_rng(5)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Q * np.sign(np.linalg.det(Q)), rng.normal(size=3)
    cam = Camera(model, 640, 480, K, np.array(DISTORTIONS[model]), name='front "left"', frame="cam_optical")
    half, wide = rng.normal(size=(6, 6)), rng.normal(size=(len(cam.parameters), len(cam.parameters)))
    return Calibration(
        cam,
        T_camera_lidar=T,
        lidar_frame="laser",
        covariance=half @ half.T * 1e-6,
        degrees=7.25,
        elevations=[-0.25, 0.125],
        camera_covariance=wide @ wide.T,
        time_offset_ns=-1234567,
        time_offset_sigma_ns=4.5e5,
        verdict="CANNOT TELL",
        pixel_error_95=[[1.0, 6.1], [2.0, 4.0]],
        provenance=Provenance({"a b.png": "00ff"}, {"wallkit": "0.1"}, "wallkit calib \\ x\n", ("one", 'two "2"')),
    )


def assert_same_camera(a: Camera, b: Camera) -> None:
    assert (a.model, a.width, a.height) == (b.model, b.width, b.height)
    np.testing.assert_array_equal(a.parameters, b.parameters)


@pytest.mark.parametrize("model", DISTORTIONS)
def test_toml_holds_everything_to_the_last_bit(model, tmp_path):
    given, path = whole(model), tmp_path / "c.toml"
    path.write_text(text_from_calibration(given, "toml"))
    again = read_calibration(path)
    assert_same_camera(again.camera, given.camera)
    for name in ("T_camera_lidar", "covariance", "camera_covariance", "pixel_error_95", "elevations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(given, name))
    for name in (
        "lidar_frame",
        "degrees",
        "camera_frame",
        "time_offset_ns",
        "time_offset_sigma_ns",
        "verdict",
        "provenance",
    ):
        assert getattr(again, name) == getattr(given, name)
    assert again.camera.name == given.camera.name
    assert text_from_calibration(again, "toml") == path.read_text()
    assert FORMATS["toml"].misses(given) == []


def test_files_of_schema_1_are_still_read(tmp_path):
    """They do not say how many degrees of freedom a covariance has: as many as it takes for the normal quantile."""
    given, path = whole("plumb_bob"), tmp_path / "old.toml"
    lines = text_from_calibration(given, "toml").replace("schema = 2", "schema = 1").splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith(("degrees_of", "elevations"))))
    old = read_calibration(path)
    assert old.degrees == np.inf
    assert old.elevations is None
    np.testing.assert_array_equal(old.covariance, given.covariance)


@pytest.mark.parametrize(
    ("name", "model"), [(f, m) for f in FORMATS for m in DISTORTIONS if (f, m) != ("kalibr", "rational_polynomial")]
)
def test_every_format_gives_the_camera_again(name, model, tmp_path):
    given, path = Calibration(camera(model)), tmp_path / f"c{FORMATS[name].suffix}"
    path.write_text(text_from_calibration(given, name))
    again = read_calibration(path)
    assert_same_camera(again.camera, given.camera)
    assert again.camera.name == "front"
    assert text_from_calibration(again, name) == path.read_text()
    assert FORMATS[name].misses(given) == []


@pytest.mark.parametrize("name", ["ros", "kalibr"])
def test_a_camera_only_format_says_what_it_leaves_out(name):
    missed = FORMATS[name].misses(whole("plumb_bob"))
    assert missed == ["T_camera_lidar", "the covariance", "the verdict", "the camera's frame"]


def test_kalibr_refuses_what_it_cannot_hold():
    with pytest.raises(CalibrationError, match="no rational_polynomial"):
        text_from_calibration(Calibration(camera("rational_polynomial")), "kalibr")
    with_k3 = camera("plumb_bob").with_parameters([600, 600, 320, 240, 0.1, 0, 0, 0, 0.2])
    with pytest.raises(CalibrationError, match=r"no k3, but it is 0\.2"):
        text_from_calibration(Calibration(with_k3), "kalibr")


def test_a_camera_info_message_written_out_is_read(tmp_path):
    (tmp_path / "c.yaml").write_text(
        "header: {frame_id: optical}\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
        "d: [0.1, 0.0, 0.0, 0.0, 0.0]\nk: [600.0, 0.0, 320.0, 0.0, 600.0, 240.0, 0.0, 0.0, 1.0]\n"
    )
    found = read_calibration(tmp_path / "c.yaml")
    assert found.camera_frame == "optical"
    assert found.camera.parameters.tolist() == [600, 600, 320, 240, 0.1, 0, 0, 0, 0]


def test_the_published_camera_infos_are_read(data):
    for name, fx in (("correct_master", 1176.93), ("WRONG_calib-v2", None)):
        found = read_calibration(data / f"calib/acfr_vlp16/camera_info_{name}.yaml").camera
        assert (found.model, found.width, found.height) == ("equidistant", 1920, 1208)
        assert fx is None or found.K[0, 0] == fx


ROS = text_from_calibration(Calibration(camera("plumb_bob")), "ros")
TOML = text_from_calibration(Calibration(camera("plumb_bob")), "toml")


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("c.yaml", ROS.replace("612.123456789012", ".nan"), "not finite"),
        ("c.yaml", ROS.replace("612.123456789012", "fx"), "'fx', which is no number"),
        ("c.yaml", ROS.replace("distortion_model: plumb_bob\n", ""), "distortion model is missing"),
        (
            "c.yaml",
            ROS.replace("distortion_model: plumb_bob", "distortion_model: plum_bob"),
            "did you mean 'plumb_bob'",
        ),
        ("c.yaml", ROS.replace("image_width: 640\n", ""), "lacks image_width"),
        ("c.yaml", ROS.replace("data: [-0.28, ", "data: ["), None),
        ("c.yaml", "a: [1", "is no YAML"),
        ("c.yaml", "- 1", "mapping"),
        ("c.yaml", "cam0: {intrinsics: [1, 2, 3], resolution: [640, 480]}", "3 numbers"),
        ("c.yaml", "cam0: {intrinsics: [1, 2, 3, 4], camera_model: omni}", "'omni' is not supported"),
        ("c.toml", "x = 1", "no calibration"),
        ("c.toml", "x = ", "is no TOML"),
        ("c.toml", TOML.replace("fx = ", "gx = "), "lacks fx"),
        ("c.toml", TOML.replace("fx = 612.123456789012", 'fx = "wide"'), "wrong type"),
        ("c.toml", TOML.replace("schema = 2", "schema = 9"), "schema = 9"),
        ("c.toml", TOML.replace('verdict = ""', 'verdict = "GOOD"'), "verdict 'GOOD'"),
    ],
)
def test_a_file_that_is_wrong_is_refused_by_name(name, text, says, tmp_path):
    (tmp_path / name).write_text(text)
    if says is None:  # plumb_bob without k3 is what OpenCV calls four coefficients
        assert len(read_calibration(tmp_path / name).camera.D) == 5
        return
    with pytest.raises(CalibrationError, match=says) as raised:
        read_calibration(tmp_path / name)
    assert name in str(raised.value)
