"""`wallkit model verify`: do two ways to run a model agree, and if not, why?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.model.verify import Verified
    from wallkit.segment.agreement import Agreement

FILE = click.Path(path_type=Path)
_MOST_MOVES = 6
_WHOLE = 0.999
_MATCH, _IOU = 0.95, 0.9
_NEITHER = "cannot tell: neither finds anything"

picture_options = common.options(
    click.option("--count", type=click.IntRange(1), default=40, show_default=True, help="Pictures, evenly spread."),
    click.option(
        "--calib", "calibration", type=FILE, metavar="FILE", help="Of the log: its LiDAR's points are labelled."
    ),
    click.option("--scan", "scan_topic", metavar="TOPIC", help="LiDAR topic of a log, when there are several."),
    click.option("--image", "image_topic", metavar="TOPIC", help="Camera topic of a log, when there are several."),
    click.option("--allow-unverified", is_flag=True, help="Use a calibration whose verdict is FAIL."),
)


@click.command()
@click.argument("a", type=FILE, metavar="A.onnx")
@click.argument("b", type=FILE, metavar="B.onnx|B.pt")
@click.option("--images", multiple=True, required=True, type=FILE, metavar="FOLDER|LOG", help="Pictures (repeatable).")
@picture_options
@click.option("--python", type=FILE, metavar="FILE", help="Interpreter with Ultralytics that runs B.pt.")
@click.option(
    "--trust", is_flag=True, help="Load all that the checkpoint holds, not only weights: it may run anything."
)
@click.option(
    "--min-match", type=common.Number(0, 1), default=_MATCH, show_default=True, help="Least share of matched things."
)
@click.option(
    "--min-iou", type=common.Number(0, 1), default=_IOU, show_default=True, help="Least mean IoU of their masks."
)
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@click.pass_context
def verify(ctx: click.Context, /, a: Path, b: Path, **flags: Any) -> None:
    """Compare two models, or a model and its checkpoint, thing by thing on pictures; needs no labels.

    A thing of A is matched by one of B of the same class whose mask overlaps it by more than an IoU of 0.5. Where they
    differ, usual causes are tried and the one that explains it is named: BGR, 0 to 255, ImageNet's or -1 to 1
    normalisation, a stretched picture, masks cropped before they are enlarged, one gain for both axes, a rectangular
    letterbox. With a log and --calib the points are the LiDAR's own.

    Exits 0 if they agree, 1 if not, 4 if neither finds anything.

    \b
    Examples:
      wallkit model verify best.onnx int8.onnx --images log.mcap --calib front.toml
      wallkit model verify best.onnx best.pt --images pictures/ --python yv/bin/python
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.model.verify import VerifyRequest, verify_models

    settings = load_config(flags["config_path"], flags["words"]).config.segment
    pictures = pictures_from_flags(flags["images"], flags)
    request = VerifyRequest(a, b, flags["python"], flags["trust"])
    with common.progress("comparing", len(pictures), quiet=flags["quiet"]) as update:
        found = verify_models(request, pictures, settings, progress=update)
    verdict = _verdict(found.agreement, flags["min_match"], flags["min_iou"])
    if flags["as_json"]:
        common.emit({"a": a, "b": b, "pictures": len(pictures), **document(found), "verdict": verdict})
    else:
        click.echo("\n".join([*page(found, len(pictures)), f"verdict  {verdict}"]))
        if found.names:
            common.warn(f"only one side has the classes {', '.join(found.names[:8])}", quiet=flags["quiet"])
    ctx.exit({"agree": common.OK, _NEITHER: common.CANNOT_TELL}.get(verdict, common.FAILED_CHECK))


def pictures_from_flags(places: tuple[Path, ...], flags: dict[str, Any]) -> list[Any]:
    """The pictures that `picture_options` name."""
    from wallkit.pipelines.model.pictures import PictureSource, pictures_of

    topics = flags["image_topic"], flags["scan_topic"]
    return pictures_of(PictureSource(places, flags["count"], flags["calibration"], *topics, flags["allow_unverified"]))


def page(found: Verified, pictures: int) -> list[str]:
    """What a person reads."""
    lines = [
        f"looked   at {pictures} {'picture' if pictures == 1 else 'pictures'}",
        *agreement_page(found.agreement, has_lidar=found.has_lidar),
    ]
    if found.rectangle is not None:
        said = f"{_things(found.rectangle)}, {_masks(found.rectangle)}"
        lines.append(f"predict  as Ultralytics runs the checkpoint by itself, with a rectangular letterbox: {said}")
    return [*lines, *(f"because  {cause}" for cause in found.causes)]


def agreement_page(total: Agreement, *, has_lidar: bool) -> list[str]:
    """How far two sides agree."""
    lines = [f"things   {_things(total)}"]
    if total.matched:
        lines += [f"masks    {_masks(total)}", f"scores   {_scores(total)}"]
        if total.worst[1] < _WHOLE:
            lines.append(f"worst    {total.worst[0]}: {total.worst[1]:.2f} of it agrees")
    ious = ", ".join(f"{role} {iou:.3f}" for role, iou in total.role_iou().items())
    lines.append(f"roles    {ious or 'none seen'} (IoU of their pixels)")
    return [*lines, f"points   {_points(total, has_lidar=has_lidar)}"]


def document(found: Verified) -> dict[str, Any]:
    """What a program reads."""
    return {
        **agreement_numbers(found.agreement),
        "points_are_lidar": found.has_lidar,
        "causes": list(found.causes),
        "classes_of_one_side": list(found.names),
        "rectangular_letterbox": None if found.rectangle is None else agreement_numbers(found.rectangle),
    }


# ------------------------------------------------------------------------------------------------ details


def is_agreed(total: Agreement, min_match: float = _MATCH, min_iou: float = _IOU) -> bool:
    """Whether the two sides agree well enough, or have nothing to differ in."""
    return _verdict(total, min_match, min_iou) in ("agree", _NEITHER)


def _verdict(total: Agreement, min_match: float, min_iou: float) -> str:
    if not max(total.of_a, total.of_b):
        return _NEITHER
    if total.share < min_match:
        return f"differ: {total.share:.0%} of the things are matched, {min_match:.0%} were asked"
    mean = sum(total.ious) / len(total.ious) if total.ious else 0.0
    return "agree" if mean >= min_iou else f"differ: mean mask IoU {mean:.3f}, {min_iou:g} was asked"


def agreement_numbers(total: Agreement) -> dict[str, Any]:
    """How far two sides agree, for a program."""
    import numpy as np

    return {
        "things_a": total.of_a,
        "things_b": total.of_b,
        "matched": total.matched,
        "missed": total.of_a - total.matched,
        "extra": total.of_b - total.matched,
        "match_share": total.share,
        "mask_iou_mean": float(np.mean(total.ious)) if total.ious else None,
        "mask_iou_min": min(total.ious, default=None),
        "score_drift_mean": float(np.mean(total.drifts)) if total.drifts else None,
        "score_drift_max": max(map(abs, total.drifts), default=None),
        "box_error_mean_px": float(np.mean(total.box_px)) if total.box_px else None,
        "role_iou": total.role_iou(),
        "points": total.points,
        "points_changed": sum(total.moved.values()),
        "points_moved": [{"from": a, "to": b, "points": n} for (a, b), n in total.moved.most_common()],
        "worst_picture": total.worst[0],
    }


def _things(total: Agreement) -> str:
    extra = total.of_b - total.matched
    missed = total.of_a - total.matched
    return f"{total.matched} of {total.of_a} matched, {missed} missed, {extra} extra"


def _masks(total: Agreement) -> str:
    if not total.ious:
        return "no masks to compare"
    return f"IoU {sum(total.ious) / len(total.ious):.4f} on average, {min(total.ious):.4f} at least"


def _scores(total: Agreement) -> str:
    return f"drift {sum(total.drifts) / len(total.drifts):+.4f} on average, {max(map(abs, total.drifts)):.4f} at most"


def _points(total: Agreement, *, has_lidar: bool) -> str:
    whose = "of the LiDAR" if has_lidar else "scattered over the pictures"
    changed = sum(total.moved.values())
    moves = ", ".join(f"{a} to {b} {n}" for (a, b), n in total.moved.most_common(_MOST_MOVES))
    return f"{changed} of {total.points} {whose} change their role" + (f": {moves}" if moves else "")
