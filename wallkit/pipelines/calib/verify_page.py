"""A verification -> its HTML page, with the LiDAR's points drawn on the worst and the median views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wallkit.calib.extrinsics.edges import DEFINITION as EDGE_DEFINITION
from wallkit.calib.verify.gates import Gate
from wallkit.calib.verify.sure import pixel_error_at
from wallkit.pipelines.calib.frames import LookFrame, frames_of
from wallkit.pipelines.calib.overlay import picture_of
from wallkit.pipelines.calib.verify import Verification, is_files, next_step, pixel_words, verdict_meaning
from wallkit.pipelines.calib.verify_document import BOARD_DEFINITION
from wallkit.points.overlay import jpeg_bytes
from wallkit.report.data import Photo
from wallkit.report.verdict import Answer, VerdictData, verdict_html

PHOTOS = 3
_REASONS = 6
_PHOTO_PX = 1100


def page_of(found: Verification) -> str:
    """The page: self-contained, the same bytes for the same inputs."""
    return verdict_html(page_data(found))


def page_data(found: Verification) -> VerdictData:
    """What the page shows."""
    evidence, judgement, limits = found.evidence, found.judgement, found.limits
    gates = [gate for _, gate in judgement.gates]
    plane = dict(judgement.gates)["plane"]
    middles = [float(np.linalg.norm(s.points_m.mean(axis=0))) for s in evidence.sightings]
    has_place = found.calibration.T_camera_lidar is not None
    camera = found.calibration.camera
    facts = [
        ("calibration", str(found.request.calibration)),
        ("judged by", ", ".join(map(str, found.request.inputs))),
        ("board", found.request.board.words if found.request.board else "none: the room is the target"),
        ("camera", f"{camera.model}, {camera.width} x {camera.height} px"),
        ("pictures", f"{found.looked_at}, the board in {len(evidence.boards)}"),
        ("sigma of a range", f"{evidence.sigma_range_m * 1e3:.0f} mm, {evidence.sigma_source}"),
        *((f"left out: {name}", why) for name, why in found.left_out),
        *(("note", note) for note in found.notes),
    ]
    said = [f"Reprojection error: {EDGE_DEFINITION}.", f"Intrinsics: {BOARD_DEFINITION}."]
    return VerdictData(
        title=f"May {found.request.calibration.name} be trusted?",
        verdict=judgement.verdict,
        meaning=verdict_meaning(found),
        means=pixel_words(found, pixel_error_at(evidence, limits.reference_m)) if has_place else "",
        next_step=next_step(found),
        reasons=tuple(g.reason for g in gates if g.verdict == judgement.verdict and g.reason)[:_REASONS],
        answers=tuple(_answer(gate) for gate in gates if gate.verdict),
        skipped=tuple(_answer(gate) for gate in gates if not gate.verdict),
        facts=tuple(facts),
        definitions=tuple([f"Held out: {evidence.held_out}.", *said] if evidence.held_out else said),
        view_names=tuple(view.name for view in evidence.views),
        distances_m=np.array(middles),
        means_mm=np.array([view.mean_mm for view in evidence.views]),
        rms_mm=np.array([view.rms_mm for view in evidence.views]),
        is_out=tuple(bool(view.why) for view in evidence.views),
        plane_limits_mm=(_bound(plane.wanted), _bound(plane.refused)),
        pixel_error=evidence.pixel_error,
        pixel_limit=limits.pixel_px * camera.width / limits.pixel_width,
        reference_m=limits.reference_m,
        photos=tuple(_photos(found)),
    )


def _answer(gate: Gate) -> Answer:
    value = f"{gate.value:.4g} {gate.unit}".rstrip() if np.isfinite(gate.value) else ""
    return Answer(gate.verdict, gate.name, value, gate.wanted, gate.refused, gate.reason, gate.basis)


def _bound(words: str) -> float:
    """The number of `<= 18`; inf where there is none."""
    return float(words.split()[-1]) if words else np.inf


def _photos(found: Verification) -> list[Photo]:
    """Overlays of the worst and the median views, or of a few frames when there is no board; none of corners alone."""
    request, evidence = found.request, found.evidence
    has_pictures = not (is_files(request.inputs) and (request.scans is None or request.inputs[0].suffix == ".npz"))
    if not has_pictures or (found.calibration.T_camera_lidar is None and found.run is None):
        return []
    T = found.calibration.T_camera_lidar if found.run is None else found.run.result.T
    calibration = found.calibration
    if calibration.T_camera_lidar is None:
        calibration = replace(calibration, T_camera_lidar=T)
    chosen = _chosen(found)
    frames = frames_of(
        request.inputs,
        request.scans,
        count=max(len(chosen), PHOTOS),
        scan_topic=request.scan_topic,
        image_topic=request.image_topic,
        named=list(chosen) if evidence.views else None,
    )
    drawn: dict[str, Photo] = {}
    for frame in frames:
        words = chosen.get(frame.name, f"Frame {frame.name}")
        picture, inside = picture_of(calibration, _thinned(frame))
        drawn[frame.name] = Photo(f"{words}. {inside} points fall on the image.", jpeg_bytes(picture, width=_PHOTO_PX))
    order = list(chosen) if evidence.views else list(drawn)
    return [drawn[name] for name in order if name in drawn]


def _chosen(found: Verification) -> dict[str, str]:
    """Names of the worst views, then of the median ones -> what to say about them."""
    views = sorted(found.evidence.views, key=lambda view: (-view.rms_mm, view.name))
    worst = views[:PHOTOS]
    middle = len(views) // 2
    usual = [v for v in views[max(0, middle - 1) : middle + 2] if v not in worst]
    words = {v.name: f"One of the worst views, {v.name}: {v.rms_mm:.0f} mm off the board (RMS)" for v in worst}
    return words | {v.name: f"A usual view, {v.name}: {v.rms_mm:.0f} mm off the board (RMS)" for v in usual}


def _thinned(frame: LookFrame, most: int = 20_000) -> LookFrame:
    if len(frame.points_m) <= most:
        return frame
    return replace(frame, points_m=frame.points_m[:: len(frame.points_m) // most + 1], intensities=None)
