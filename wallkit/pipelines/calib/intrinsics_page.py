"""A calibrated camera -> its HTML page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.calib.board.views import observations_of
from wallkit.calib.camera.intrinsics import rms_by_view
from wallkit.pipelines.calib.intrinsics import DEFINITION, CameraResult
from wallkit.report.camera import CameraData, camera_html
from wallkit.report.verdict import Answer

_MEANINGS = {
    "PASS": "the camera may be used; how sure each number is stands below.",
    "FAIL": "this camera must not be used.",
    "CANNOT TELL": "nothing is wrong that can be seen, but the views do not show that it is right.",
}
_SIGMAS = (
    "Sigmas are clustered by view, since the corners of one board err together; 95 % takes Student's t with the degrees of"
    " freedom that the views leave. They assume a flat board."
)


def page_of(result: CameraResult, inputs: Sequence[str]) -> str:
    """The page: self-contained, the same bytes for the same inputs."""
    return camera_html(page_data(result, inputs))


def page_data(result: CameraResult, inputs: Sequence[str]) -> CameraData:
    """What the page shows."""
    found, capture, camera = result.found, result.capture, result.found.camera
    used = dict(zip((v.name for v in found.views), found.view_rms_px.tolist(), strict=True))
    plain = rms_by_view(found.plain, observations_of(capture.views, capture.board)).tolist()
    names = tuple(view.name for view in capture.views)
    halves = found.spread.half_widths()
    facts = [
        ("from", ", ".join(inputs)),
        ("board", capture.board.words),
        ("camera", f"{camera.model}, {camera.width} x {camera.height} px"),
        ("views", f"{len(found.views)} used, of {capture.looked_at} pictures"),
        *((f"left out: {why}", f"{count} pictures") for why, count in capture.left_out),
        *((f"rejected: {name}", why) for name, why in found.rejected_views.items()),
        ("rejected corners", str(found.rejected_corners)),
    ]
    if result.difference is not None:
        name, difference = result.difference
        words = f"puts pixels elsewhere by {difference.median:.2f} px (median), {difference.worst:.2f} px (worst)"
        facts.append((f"{name} instead", words))
    return CameraData(
        title=f"The camera {result.calibration.camera.name}".rstrip(),
        verdict=result.verdict,
        meaning=_MEANINGS[result.verdict],
        reasons=tuple(g.reason for g in result.gates if g.reason),
        answers=tuple(
            Answer(g.verdict, g.name, f"{g.value:.4g} {g.unit}".rstrip(), g.wanted, g.refused, g.reason, g.basis)
            for g in result.gates
        ),
        parameters=tuple(
            (name, f"{value:.4f}", f"{sigma:.4f}" if free else "held", f"± {half:.4f}" if free else "")
            for name, value, sigma, half, free in zip(
                camera.parameter_names,
                camera.parameters.tolist(),
                found.sigmas.tolist(),
                halves.tolist(),
                found.free.tolist(),
                strict=True,
            )
        ),
        models=tuple(
            (
                c.model,
                str(c.parameters),
                f"{c.fit_rms_px:.4f}",
                f"{c.held_out_rms_px:.4f}" if np.isfinite(c.held_out_rms_px) else "",
                f"{c.bic:.0f}",
                "sound" if c.grows_to_corner else "folds back",
            )
            for c in result.tried
        ),
        facts=tuple(facts),
        definitions=(
            f"Fit: {found.fit.rms_px:.4f} px, {DEFINITION}. It is no measure of quality: more parameters make it smaller.",
            _SIGMAS,
        ),
        size=(camera.width, camera.height),
        pixels=found.seen.pixels,
        residuals=found.fit.residuals,
        us=result.sigma_far.us,
        vs=result.sigma_far.vs,
        sigma_px=result.sigma_far.values,
        view_names=names,
        view_rms_px=np.array([used.get(name, value) for name, value in zip(names, plain, strict=True)]),
        is_out=tuple(name not in used for name in names),
    )
