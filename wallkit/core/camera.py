"""A camera: points of the optical frame -> pixels and back, with the Jacobians that calibration and its errors need.

Optical frame: x right, y down, z forward. Pixel (0, 0) is the centre of the top-left pixel; (u, v) = (right, down).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.lenses import CAMERAS, Lens
from wallkit.core.types import BoolArray, CameraInfo, Float64Array
from wallkit.errors import CalibrationError, closest

ALIASES = {"fisheye": "equidistant", "radtan": "plumb_bob", "rational": "rational_polynomial"}


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics of one camera, checked when built; arrays are read-only.

    Attributes:
        model: a name of CAMERAS, or one of its aliases (kept as the name of CAMERAS).
        width, height: of the image [px].
        K: (3, 3) float64 camera matrix without skew [px].
        D: (n,) float64 distortion, as many as the model has coefficients; a plumb_bob without k3 gets k3 = 0, and zeros
            beyond the model's coefficients are dropped.
        name: of the camera, for people. frame: its optical frame in the robot's tree.

    Raises:
        CalibrationError: what is wrong, with the value.
    """

    model: str
    width: int
    height: int
    K: Float64Array
    D: Float64Array
    name: str = ""
    frame: str = ""

    def __post_init__(self) -> None:
        label = f"camera '{self.name}'" if self.name else "camera"
        model = ALIASES.get(self.model.lower(), self.model.lower())
        if not model:
            hint = f"write distortion_model, one of: {', '.join(sorted(CAMERAS))}"
            raise CalibrationError("the distortion model is missing", where=label, hint=hint)
        if model not in CAMERAS:
            hint = closest(model, [*CAMERAS, *ALIASES])
            raise CalibrationError(f"distortion model '{self.model}' is not known", where=label, hint=hint)
        if self.width <= 0 or self.height <= 0:
            raise CalibrationError(f"image size {self.width} x {self.height} is not positive", where=label)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "K", _checked_matrix(self.K, label))
        object.__setattr__(self, "D", _checked_coefficients(self.D, CAMERAS[model], label))

    @cached_property
    def lens(self) -> Lens:
        """The distortion model."""
        return CAMERAS[self.model]

    @cached_property
    def limit(self) -> float:
        """How far from the axis the radial map grows: radius at unit depth, or angle [rad] of `equidistant`."""
        return self.lens.limit(self.D)

    @cached_property
    def compiled(self) -> tuple[Float64Array, Float64Array]:
        """(6,) fx, fy, cx, cy, width, height and (8,) D with zeros behind, as compiled loops take them."""
        D = np.zeros(8)
        D[: len(self.D)] = self.D
        return np.array([*self.K[[0, 1, 0, 1], [0, 1, 2, 2]], self.width, self.height]), D

    @property
    def parameters(self) -> Float64Array:
        """(4 + n,) fx, fy, cx, cy and D, in the order of `parameter_jacobian` and of covariances."""
        return np.concatenate([self.K[[0, 1, 0, 1], [0, 1, 2, 2]], self.D])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of `parameters`."""
        return ("fx", "fy", "cx", "cy", *self.lens.coefficients)

    def with_parameters(self, parameters: ArrayLike) -> Camera:
        """The same camera with other fx, fy, cx, cy and D (4 + n,)."""
        fx, fy, cx, cy, *D = np.asarray(parameters, dtype=np.float64)
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        return Camera(self.model, self.width, self.height, K, np.array(D), self.name, self.frame)

    def project(self, points: ArrayLike) -> Float64Array:
        """Pixels (..., 2) of points (..., 3) in the optical frame [m].

        Behind the camera, and where the distortion no longer grows with the angle: NaN. A pixel may lie outside the image
        (see `is_inside`). `equidistant` sees points behind the plane z = 0 as long as its radial map grows.
        """
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, 3)
        with np.errstate(all="ignore"):
            sees = self.lens.reach(flat) < self.limit
            pixels = self.lens.distort(flat, self.D) * self.K[[0, 1], [0, 1]] + self.K[:2, 2]
        return np.where(sees[:, None], pixels, np.nan).reshape(*points.shape[:-1], 2)

    def unproject(self, pixels: ArrayLike) -> Float64Array:
        """Unit rays (..., 3) in the optical frame that pixels (..., 2) look along; NaN where the model has none."""
        pixels = np.asarray(pixels, dtype=np.float64)
        distorted = (pixels.reshape(-1, 2) - self.K[:2, 2]) / self.K[[0, 1], [0, 1]]
        return self.lens.undistort(distorted, self.D).reshape(*pixels.shape[:-1], 3)

    def point_jacobian(self, points: ArrayLike) -> Float64Array:
        """d pixel / d point, (..., 2, 3) [px/m], at points (..., 3); NaN where `project` is."""
        points = np.asarray(points, dtype=np.float64)
        by_point, _ = self._jacobians(points.reshape(-1, 3))
        return by_point.reshape(*points.shape[:-1], 2, 3)

    def parameter_jacobian(self, points: ArrayLike) -> Float64Array:
        """d pixel / d (fx, fy, cx, cy, D), (..., 2, 4 + n), at points (..., 3); NaN where `project` is."""
        points = np.asarray(points, dtype=np.float64)
        _, by_parameter = self._jacobians(points.reshape(-1, 3))
        return by_parameter.reshape(*points.shape[:-1], 2, -1)

    def is_inside(self, pixels: ArrayLike) -> BoolArray:
        """(...,) whether pixels (..., 2) fall on the image; NaN does not."""
        pixels = np.asarray(pixels, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= -0.5) & (pixels < (self.width - 0.5, self.height - 0.5))
        return np.asarray(inside.all(axis=-1))

    def _jacobians(self, flat: Float64Array) -> tuple[Float64Array, Float64Array]:
        """d pixel / d point and d pixel / d parameters of points (N, 3)."""
        focal = self.K[[0, 1], [0, 1]]
        with np.errstate(all="ignore"):
            sees = self.lens.reach(flat) < self.limit
            distorted = self.lens.distort(flat, self.D)
            by_point, by_lens = self.lens.jacobians(flat, self.D)
        by_parameter = np.zeros((len(flat), 2, 4 + len(self.D)))
        by_parameter[:, [0, 1], [0, 1]] = distorted
        by_parameter[:, [0, 1], [2, 3]] = 1
        by_parameter[:, :, 4:] = by_lens * focal[:, None]
        blind = ~sees[:, None, None]
        return np.where(blind, np.nan, by_point * focal[:, None]), np.where(blind, np.nan, by_parameter)


def camera_from_info(info: CameraInfo, *, name: str = "") -> Camera:
    """The camera that a recorded camera_info describes.

    Raises:
        CalibrationError: it is not a usable camera (no distortion model, NaN, zero focal length, ...).
    """
    return Camera(info.model, info.width, info.height, info.k, info.d, name, info.frame_id)


def _checked_matrix(given: ArrayLike, label: str) -> Float64Array:
    K = np.array(given, dtype=np.float64)
    if K.shape != (3, 3):
        raise CalibrationError(f"the camera matrix is {K.shape}, not 3 x 3", where=label)
    if not np.isfinite(K).all():
        raise CalibrationError(f"the camera matrix holds numbers that are not finite: {K.tolist()}", where=label)
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        hint = "a driver that was never calibrated publishes zeros: run `wallkit calib intrinsics`"
        raise CalibrationError(f"focal lengths {K[0, 0]:g}, {K[1, 1]:g} are not positive", where=label, hint=hint)
    if K[0, 1] != 0 or K[1, 0] != 0 or (K[2] != (0, 0, 1)).any():
        raise CalibrationError(f"the camera matrix has skew or a wrong last row: {K.tolist()}", where=label)
    K.flags.writeable = False
    return K


def _checked_coefficients(given: ArrayLike, lens: Lens, label: str) -> Float64Array:
    D = np.array(given, dtype=np.float64).ravel()
    count = len(lens.coefficients)
    if not np.isfinite(D).all():
        raise CalibrationError(f"the distortion holds numbers that are not finite: {D.tolist()}", where=label)
    if lens.name == "plumb_bob" and len(D) == 4:
        D = np.append(D, 0.0)
    if len(D) > count and not D[count:].any():
        D = D[:count].copy()
    if len(D) != count:
        hint = f"{lens.name} is {', '.join(lens.coefficients)}; a rectified image has {count} zeros"
        raise CalibrationError(f"{lens.name} needs {count} coefficients, not {len(D)}", where=label, hint=hint)
    D.flags.writeable = False
    return D
