"""A world and its looks -> pictures and solids by pixel of a pinhole camera anywhere in it, rendered by MuJoCo on OpenGL."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from wallkit.core.types import Float64Array, Int64Array, UInt8Array
from wallkit.simulate.gl import renderer
from wallkit.simulate.looks import Wardrobe
from wallkit.simulate.optics import Pinhole
from wallkit.simulate.scene import GROUPS, NOTHING, add_primitive, compiled, mujoco_module, pose_mocap
from wallkit.simulate.set_pieces import Piece, Primitive, pieces_of
from wallkit.simulate.world import MAP, Light

if TYPE_CHECKING:
    import mujoco

_NEAR_M, _FAR_M = 0.02, 120.0
_AMBIENT, _HEADLIGHT, _LAMP = 0.40, 0.10, 0.55
# light falls to a third over so many metres from a lamp
_REACH_M = 5.0


class Studio:
    """A dressed world that can be posed and photographed. Close it, or use it in a `with` block.

    Args:
        samples: per pixel for smooth edges: 0, 2 or 4.
        fine: rendered so many times larger each way and averaged, which also smooths textures, as a real pixel does.

    Raises:
        SimulationError: MuJoCo is not installed or does not take the world; (when a picture is asked for) no OpenGL works.
    """

    def __init__(self, wardrobe: Wardrobe, *, samples: int = 4, fine: int = 1) -> None:
        self._fine = fine
        self.wardrobe = wardrobe
        self.world = wardrobe.world
        pieces = pieces_of(wardrobe)
        self._lamps = wardrobe.lights(*pieces.ceiling)
        self._lights = wardrobe.light_count(len(self._lamps))
        self.model = compiled(_spec(wardrobe, pieces.all, self._lights, samples), self.world)
        self.data = mujoco_module().MjData(self.model)
        # pieces are named by their order; which solid each belongs to
        self.solid_of_geom = np.full(self.model.ngeom, NOTHING, dtype=np.int64)
        for number, piece in enumerate(pieces.all):
            self.solid_of_geom[self.model.geom(f"piece{number}").id] = piece.solid
        self._mirrors = self.model.mat_reflectance.copy()
        self._renderers: dict[tuple[int, int], Any] = {}
        self.place(self.world.poses())

    def place(self, poses: Mapping[str, Float64Array]) -> None:
        """Puts bodies (by name, T_map_body (4, 4)) where they are at one moment."""
        pose_mocap(self.model, self.data, self._mocap, poses)

    def picture(self, eye: Pinhole, T_map_optical: Float64Array) -> UInt8Array:
        """(height, width, 3) RGB."""
        import cv2

        camera = self._aimed(eye.finer(self._fine), T_map_optical, ("opaque", "glass", "mirror", "none"))
        picture = np.asarray(camera.render())
        if self._fine == 1:
            return picture
        return np.asarray(cv2.resize(picture, (eye.width, eye.height), interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def solids(self, eye: Pinhole, T_map_optical: Float64Array, *, unseen: tuple[Light, ...] = ()) -> Int64Array:
        """(height, width) the solid that each pixel shows, NOTHING for none; solids of some kinds left out."""
        seen: tuple[Light, ...] = ("opaque", "glass", "mirror", "none")
        camera = self._aimed(eye, T_map_optical, tuple(light for light in seen if light not in unseen))
        camera.enable_segmentation_rendering()
        geoms = camera.render()[..., 0]
        camera.disable_segmentation_rendering()
        return np.where(geoms == NOTHING, NOTHING, self.solid_of_geom[geoms])

    def close(self) -> None:
        """Frees what OpenGL holds."""
        for made in self._renderers.values():
            made.close()
        self._renderers.clear()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -------------------------------------------------------------------------------------------- details

    @cached_property
    def _mocap(self) -> dict[str, int]:
        return {body.name: int(self.model.body(body.name).mocapid[0]) for body in self.world.bodies}

    @cached_property
    def _has_files(self) -> bool:
        return any(solid.kind == "mesh" for solid in self.world.solids)

    def _aimed(self, eye: Pinhole, T_map_optical: Float64Array, seen: tuple[Light, ...]) -> Any:
        """The renderer of a size with its scene seen from a place."""
        mujoco = mujoco_module()
        size = (eye.width, eye.height)
        if size not in self._renderers:
            self._renderers[size] = renderer(self.model, *size)
        camera = self._renderers[size]
        self._light(T_map_optical[:3, 3])
        option = mujoco.MjvOption()
        option.geomgroup[:] = 0
        option.geomgroup[[GROUPS[light] for light in seen]] = 1
        camera.update_scene(self.data, scene_option=option)
        camera.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self.wardrobe.looks.shadows
        # rays meet both sides of a triangle; a file may have them inside out
        camera.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = not self._has_files
        left, right, bottom, top = (_NEAR_M * side for side in eye.frustum)
        # both eyes of the stereo pair are the same one
        for view in camera.scene.camera:
            view.pos[:] = T_map_optical[:3, 3]
            view.forward[:] = T_map_optical[:3, 2]
            view.up[:] = -T_map_optical[:3, 1]
            view.frustum_near, view.frustum_far = _NEAR_M, _FAR_M
            view.frustum_center, view.frustum_width = (left + right) / 2, (right - left) / 2
            view.frustum_bottom, view.frustum_top = bottom, top
        return camera

    def _light(self, at: Float64Array) -> None:
        """The lamps nearest to the camera are the lights; they fade with distance, so none goes out suddenly."""
        places = np.array([lamp.at for lamp in self._lamps])
        nearest = np.argsort(np.hypot(*(places[:, :2] - at[:2]).T), kind="stable")[: self._lights]
        for light, lamp in enumerate(nearest.tolist()):
            self.data.light_xpos[light] = self._lamps[lamp].at
            self.data.light_xdir[light] = (0.0, 0.0, -1.0)
            power = _LAMP * self.wardrobe.looks.brightness
            self.model.light_diffuse[light] = power * np.array(self._lamps[lamp].colour)


def _spec(wardrobe: Wardrobe, pieces: tuple[Piece | Primitive, ...], lights: int, samples: int) -> mujoco.MjSpec:
    mujoco = mujoco_module()
    spec = mujoco.MjSpec()
    spec.modelname = wardrobe.world.name or "world"
    carriers = {MAP: spec.worldbody}
    for body in wardrobe.world.bodies:
        carriers[body.name] = spec.worldbody.add_body(name=body.name, mocap=True)
    brightness = wardrobe.looks.brightness
    spec.visual.headlight.ambient = [_AMBIENT * brightness] * 3
    spec.visual.headlight.diffuse = [_HEADLIGHT * brightness] * 3
    spec.visual.headlight.specular = [0.0] * 3
    spec.visual.quality.offsamples = samples
    spec.visual.quality.shadowsize = 2048
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 32, 16
    spec.stat.extent = 10.0
    for _ in range(lights):
        spec.worldbody.add_light(
            pos=[0, 0, 2.5], dir=[0, 0, -1], attenuation=[1.0, 0.0, 2.0 / _REACH_M**2], cutoff=85.0, exponent=1.0,
            castshadow=wardrobe.looks.shadows, specular=[0.25] * 3,
        )  # fmt: skip
    _add_sky(spec)
    names: dict[int, str] = {}
    for number, piece in enumerate(pieces):
        key = id(piece.surface)
        if key not in names:
            names[key] = _add_material(spec, piece, len(names))
        carrier = carriers[wardrobe.world.solids[piece.solid].body]
        light = wardrobe.world.solids[piece.solid].light
        common = {"name": f"piece{number}", "material": names[key], "group": GROUPS[light]}
        if isinstance(piece, Primitive):
            add_primitive(spec, carrier, piece.shape, **common)
        else:
            _add_mesh(spec, carrier, piece, common)
    return spec


def _add_mesh(spec: mujoco.MjSpec, carrier: Any, piece: Piece, common: dict[str, Any]) -> None:
    mujoco = mujoco_module()
    name = f"mesh of {common['name']}"
    spec.add_mesh(
        name=name,
        uservert=piece.vertices.ravel().tolist(),
        userface=piece.triangles.ravel().tolist(),
        usertexcoord=piece.uvs.ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    carrier.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0, **common)


def _add_material(spec: mujoco.MjSpec, piece: Piece | Primitive, number: int) -> str:
    mujoco = mujoco_module()
    surface = piece.surface
    name = f"surface{number}"
    material = spec.add_material(
        name=name, rgba=list(surface.rgba), emission=surface.glow, specular=surface.shine, shininess=0.5
    )
    material.reflectance = surface.reflects
    if surface.texture is not None:
        h, w = surface.texture.pixels.shape[:2]
        texture = spec.add_texture(
            name=f"texture{number}", type=mujoco.mjtTexture.mjTEXTURE_2D, width=w, height=h, nchannel=3
        )
        texture.data = np.ascontiguousarray(surface.texture.pixels).tobytes()
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture.name
    return name


def _add_sky(spec: mujoco.MjSpec) -> None:
    """What one sees through a window."""
    mujoco = mujoco_module()
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.75, 0.85, 0.95],
        rgb2=[0.55, 0.58, 0.55],
        width=64,
        height=64,
    )
