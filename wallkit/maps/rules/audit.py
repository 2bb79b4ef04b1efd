"""A, a map against a log: what is not there, what is there and not drawn, what stands elsewhere, and how doors stood.

These rules need the evidence of a log and run in `wallkit map audit` only.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wallkit.core.geometry import invert
from wallkit.maps.audit.nouns import Cluster, DoorEvidence, ElementEvidence, Evidence, Shift
from wallkit.maps.audit.paste import command_for, paste_for, unused_name
from wallkit.maps.document import Edit
from wallkit.maps.nouns import Joint
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule

# an offset is told when it is so many standard deviations from nothing
_SURE = 3.0
# and when the wall was seen from so many places
_PLACES_MIN = 3
# an element is gone when so much of what was seen of it was seen through
_GONE = 0.7
_THROUGH_MIN = 5
_UNSEEN_MIN_M = 0.2
_TOLD_MIN = 3


def a001_unsupported(context: Context) -> Iterator[Problem]:
    """Beams went through an element, or through a good part of it: it is not there.

    The robot looked at it and nothing came back from it; what came back lay behind. Glass and mirrors are not judged.

    Bad: a wall that was torn down, and that many beams of the log passed.
    Good: every wall that the LiDAR looked at returns its beams.
    """
    for element in _evidence(context).elements.values():
        if not _is_missing(context, element):
            continue
        whole = element.unsupported_m >= _GONE * element.observed_m
        noun = context.map.links[element.link].class_name or "element"
        if whole:
            message = f"{noun} '{element.link}' is not there: beams went through it in up to {element.through} views"
            hint = f"wallkit map remove {context.document.source} {element.link}, if the room has changed for good"
        else:
            message = (
                f"{element.unsupported_m:.2f} m of the {element.observed_m:.2f} m seen of {noun} '{element.link}' are not "
                f"there: beams went through in up to {element.through} views"
            )
            hint = "an opening that is not drawn? wallkit map show with --names shows where"
        detail = {
            "link": element.link,
            "unsupported_m": element.unsupported_m,
            "observed_m": element.observed_m,
            "views": element.views,
            "through_views": element.through,
        }
        yield Problem(context.map.links[element.link].element, message, hint, xyz=element.at, detail=detail)


def a002_unexplained(context: Context) -> Iterator[Problem]:
    """Something stands where the map has nothing.

    Its returns were there whenever a beam came that way, for longer than a person stands. Size and place are those of its
    outline at the LiDAR's height; the class is a guess.

    Bad: a cupboard that was moved in since the map was drawn.
    Good: people who walk through the room raise nothing.
    """
    found = _evidence(context)
    at = context.map.header.element or context.root
    taken: set[str] = set(context.map.links)
    for cluster in found.clusters:
        name = unused_name(cluster.class_name, taken)
        taken.add(name)
        (x, y, yaw), (long_m, deep_m) = cluster.pose, cluster.size_m
        where = f" at wall '{cluster.wall}'" if cluster.wall else ""
        message = (
            f"{cluster.returns} returns in {cluster.views} views over {cluster.seen_over_s:.0f} s are from something that "
            f"is not in the map: {long_m:.2f} x {deep_m:.2f} m, turned by {math.degrees(yaw):.0f} deg{where}"
        )
        hint = f"{cluster.class_name}? look, then {command_for(cluster, name)}"
        related = (("the wall it stands at", context.map.links[cluster.wall].element),) if cluster.wall else ()
        detail = {**_cluster_detail(cluster), "paste": paste_for(cluster, name)}
        yield Problem(at, message, hint, xyz=(x, y), related=related, detail=detail)


def a003_shifted(context: Context) -> Iterator[Problem]:
    """An element stands elsewhere than it is drawn, or is thicker or thinner.

    The offset is along its normal, with its standard deviation: the poses' own errors are in it, and views from one place
    count once; so is the sigma that the map gives the element. It is told against the bulk of the map, so a map that is off
    as a whole raises WK-A004 only.

    Bad: a wall drawn 3 cm beside where it stands.
    Good: offsets within what their standard deviation explains.
    """
    tolerance_m = context.tolerances.audit_shift_m
    for element in _evidence(context).elements.values():
        if _is_missing(context, element):
            continue
        link = context.map.links[element.link]
        # what the map itself says about how well it is known
        known_m = link.sigma_m or context.map.header.sigma_m or 0.0
        shifts = [
            replace(s, sd_m=math.hypot(s.sd_m, known_m), thicker_sd_m=math.hypot(s.thicker_sd_m, known_m))
            for s in element.shifts
        ]
        off = [s for s in shifts if _is_off(s.offset_m, s.sd_m, s.places, tolerance_m)]
        thick = [s for s in shifts if _is_off(s.thicker_m, s.thicker_sd_m, s.places, tolerance_m)]
        if not off and not thick:
            continue
        words = [_shift_words(shift) for shift in off]
        words += [
            f"is {_cm(abs(s.thicker_m), s.thicker_sd_m)} {'thicker' if s.thicker_m > 0 else 'thinner'} than drawn"
            for s in thick
        ]
        moved = np.sum([np.array(s.normal) * s.offset_m for s in off], axis=0) if off else np.zeros(2)
        joint = context.map.parent_joint(element.link)
        edits = _moved_by(context, joint, moved) if off and joint is not None else ()
        by = f"--by {moved[0]:.3f},{moved[1]:.3f}"
        hint = f"wallkit map move {context.document.source} {element.link} {by}" if off else ""
        if off and len(context.map.subtree(element.link)) > 1:
            hint += "; what hangs on it moves along, but with --leave-children"
        detail = {
            "link": element.link,
            "shifts": [{"normal": s.normal, "offset_m": s.offset_m, "sd_m": s.sd_m, "places": s.places} for s in off],
            "thicker_m": [s.thicker_m for s in thick],
        }
        noun = link.class_name or "element"
        message = f"{noun} '{element.link}' {' and '.join(words)}"
        related = (("its joint", joint.element),) if joint is not None else ()
        yield Problem(link.element, message, hint, xyz=element.at, related=related, edits=edits, detail=detail)


def a004_drift(context: Context) -> Iterator[Problem]:
    """The map as a whole has the wrong scale, heading or origin.

    Scale shows in any log. Heading and origin show only against poses that do not come from the map itself (--truth). Single
    elements are then judged with the map put right.

    Bad: a map drawn 2 % too large.
    Good: a map and a log that agree as a whole.
    """
    drift = _evidence(context).drift
    if not drift.is_significant:
        return
    (x, y, yaw, scale), sd = drift.values.tolist(), drift.sd.tolist()
    words, hints = [], []
    if abs(scale) > _SURE * sd[3] and abs(scale) >= 0.002:
        size = "small" if scale > 0 else "large"
        words.append(f"{abs(scale) * 100:.2f} +- {sd[3] * 100:.2f} % too {size}")
        hints.append(f"wallkit map scale {context.document.source} {1 + scale:.5f}")
    if math.isfinite(sd[0]):
        if abs(yaw) > _SURE * sd[2] and abs(yaw) >= math.radians(0.2):
            words.append(f"turned by {-math.degrees(yaw):.2f} +- {math.degrees(sd[2]):.2f} deg")
        if math.hypot(x, y) > _SURE * max(sd[0], sd[1]):
            words.append(f"off by x {-x:.3f}, y {-y:.3f} m (+- {max(sd[0], sd[1]):.3f})")
        if len(words) > len(hints):
            to = ",".join(f"{value:.5g}" for value in invert([x, y, yaw]))
            hints.append(f"wallkit map origin {context.document.source} --to {to}")
    message = f"the map as a whole is {', '.join(words) or 'not where the log has it'}"
    hint = "; ".join([*hints, "the other findings are told as if that were done"])
    detail = {"x_m": x, "y_m": y, "yaw_rad": yaw, "scale": 1 + scale, "sd": sd}
    yield Problem(context.map.header.element or context.root, message, hint, detail=detail)


def a005_doors(context: Context) -> Iterator[Problem]:
    """A door mostly stood otherwise than at rest, or as its prior says it never does.

    Bad: a door that the map has closed and that stood open all day.
    Good: a door that stood as the map draws it.
    """
    for door in _evidence(context).doors.values():
        joint = context.map.joints[door.joint]
        if len(door.states) < _TOLD_MIN:
            continue
        seen = Counter(state_name(joint, door, float(state)) for state in door.states)
        at_rest = state_name(joint, door, joint.rest)
        prior = (joint.state.prior if joint.state is not None else None) or {}
        most = seen.most_common(1)[0][0]
        # what the prior leaves over may be anywhere
        ruled_out = [
            name
            for name, count in seen.items()
            if prior and prior.get(name, prior.get("unknown", 0.0)) < 0.05 and count >= 0.2 * len(door.states)
        ]
        if most == at_rest and not ruled_out:
            continue
        counts = ", ".join(f"{_state_words(joint, door, name)} in {count}" for name, count in seen.most_common())
        said = joint.state.prior_text if joint.state is not None else ""
        message = f"door '{door.link}' was seen {counts} of {len(door.states)} views; it is drawn at {joint.rest:g}"
        message += f" with the prior {said}" if said else ""
        share = {name: (count + 0.5) / (len(door.states) + 1.5) for name, count in seen.items()}
        usual = float(np.median([s for s in door.states if state_name(joint, door, float(s)) == most]))
        known = {name: round(0.95 * share.get(name, 0.05), 2) for name in ("closed", "open")}
        known["unknown"] = round(1 - sum(known.values()), 2)
        hint = f'if that is usual: rest="{usual:.2f}" prior="{" ".join(f"{k}:{v:g}" for k, v in known.items())}"'
        at = joint.state.element if joint.state is not None else joint.element
        detail = {"door": door.link, "joint": door.joint, "seen": dict(seen), "states": door.states.tolist()}
        place = context.poses.get(door.link)
        yield Problem(at, message, hint, xyz=() if place is None else tuple(place[:2, 3]), detail=detail)


def a006_unseen(context: Context) -> Iterator[Problem]:
    """The log never looked at an element, so it says nothing about it.

    Bad: a wall of a room that the robot did not enter.
    Good: a drive that sees everything the LiDAR can see.
    """
    for element in _evidence(context).elements.values():
        if element.observed_m > 0 or element.length_m < _UNSEEN_MIN_M:
            continue
        noun = context.map.links[element.link].class_name or "element"
        message = f"{noun} '{element.link}' was never looked at ({element.length_m:.2f} m of outline)"
        detail = {"link": element.link, "length_m": element.length_m}
        yield Problem(context.map.links[element.link].element, message, xyz=element.at, detail=detail)


def state_name(joint: Joint, door: DoorEvidence, state: float) -> str:
    """closed, open or ajar."""
    if abs(state - joint.closed) <= door.tolerance:
        return "closed"
    return "open" if abs(state - joint.open) <= door.tolerance else "ajar"


# -------------------------------------------------------------------------------------------- details


def _evidence(context: Context) -> Evidence:
    if context.evidence is None:
        raise ValueError("a rule of group A ran without a log")
    return context.evidence


def _is_missing(context: Context, element: ElementEvidence) -> bool:
    """Whether enough of an element was seen through."""
    is_large = element.unsupported_m >= context.tolerances.audit_unsupported_m
    is_most = element.observed_m > 0 and element.unsupported_m >= _GONE * element.observed_m
    return element.through >= _THROUGH_MIN and element.unsupported_m > 0 and (is_large or is_most)


def _is_off(offset_m: float, sd_m: float, places: int, tolerance_m: float) -> bool:
    return places >= _PLACES_MIN and abs(offset_m) > max(tolerance_m, _SURE * sd_m)


def _shift_words(shift: Shift) -> str:
    heading = math.degrees(math.atan2(shift.normal[1], shift.normal[0]))
    if shift.offset_m < 0:
        heading += 180.0
    towards = {0: "+x", 90: "+y", 180: "-x", 270: "-y"}.get(round(heading) % 360, f"{heading % 360:.0f} deg")
    return f"stands {_cm(abs(shift.offset_m), shift.sd_m)} farther towards {towards} than drawn"


def _cm(value_m: float, sd_m: float) -> str:
    return f"{value_m * 100:.1f} +- {sd_m * 100:.1f} cm"


def _moved_by(context: Context, joint: Joint, moved: np.ndarray) -> tuple[Edit, ...]:
    """The edit of a joint's origin that moves its child by (x, y) in frame map; none where no origin is written."""
    origin = joint.element.find("origin")
    xyz = origin.attribute("xyz") if origin is not None else None
    parent = context.poses.get(joint.parent)
    if xyz is None or parent is None:
        return ()
    place = joint.T_parent_child[:3, 3] + parent[:3, :3].T @ np.array([*moved, 0.0])
    return (xyz.replaced_by(" ".join(text_from_number(round(float(value), 4) + 0.0) for value in place)),)


def _cluster_detail(cluster: Cluster) -> dict[str, object]:
    x, y, yaw = cluster.pose
    return {
        "x_m": x,
        "y_m": y,
        "yaw_rad": yaw,
        "size_m": cluster.size_m,
        "class": cluster.class_name,
        "wall": cluster.wall,
        "room_kind": cluster.room_kind,
        "views": cluster.views,
        "returns": cluster.returns,
        "sides_seen": cluster.sides,
    }


def _state_words(joint: Joint, door: DoorEvidence, name: str) -> str:
    if name != "ajar":
        return name
    unit = "m" if joint.kind == "prismatic" else "rad"
    ajar = [float(s) for s in door.states if state_name(joint, door, float(s)) == "ajar"]
    return f"at {np.median(ajar):.2f} {unit}"


RULES = (
    Rule("WK-A001", "warning", a001_unsupported, needs_log=True),
    Rule("WK-A002", "warning", a002_unexplained, needs_log=True),
    Rule("WK-A003", "warning", a003_shifted, fix="moderate", needs_log=True),
    Rule("WK-A004", "error", a004_drift, needs_log=True),
    Rule("WK-A005", "info", a005_doors, needs_log=True),
    Rule("WK-A006", "info", a006_unseen, needs_log=True),
)
