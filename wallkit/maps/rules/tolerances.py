"""Where each rule draws the line: one table of settings, every value with its unit and reason."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.core.config import setting


@dataclass(frozen=True)
class Tolerances:
    """How strict the map rules are, and what the LiDAR and the robot are like."""

    # what the map is for; these beat what the map itself says in <wk:map> and <wk:check>
    scan_plane_m: float | None = setting(None, "height of the LiDAR's plane; none: what the map says", low=0)
    max_range_m: float | None = setting(None, "range of the LiDAR; none: what the map says", low=0)
    robot_radius_m: float | None = setting(None, "radius of the robot; none: what the map says", low=0)
    # G
    depth: int = setting(8, "longest chain of joints before WK-G009", low=1)
    axis_length: float = setting(1e-3, "how far from 1 the length of a joint axis may be (WK-G023)", low=0)
    # E: single elements
    thin_m: float = setting(0.005, "thinner than this is suspicious, but for glass and mirrors (WK-E003)", low=0)
    thick_m: float = setting(0.8, "a wall thicker than this is suspicious (WK-E004)", low=0)
    aspect: float = setting(1.5, "a wall's least ratio of length to thickness (WK-E004)", low=1)
    tall_m: float = setting(6.0, "higher than this is no storey (WK-E005)", low=0)
    tilt_rad: float = setting(0.0175, "a wall leaning by more is tilted (WK-E032); one degree", low=0)
    # E: elements against each other
    penetration_m: float = setting(0.005, "how deep a fixture may stand in a wall (WK-E010)", low=0)
    off_wall_m: float = setting(0.02, "how far a wall-mounted thing may be off its wall (WK-E012)", low=0)
    coincident_share: float = setting(0.9, "overlap at which two elements are duplicates (WK-E014)", low=0, high=1)
    gap_min_m: float = setting(0.001, "wall ends closer than this touch (WK-E020)", low=0)
    gap_max_m: float = setting(0.3, "wall ends farther apart are not meant to touch (WK-E020)", low=0)
    junction_m: float = setting(0.05, "how far a T junction may miss and still be one (WK-E022)", low=0)
    floor_gap_m: float = setting(0.02, "how far above the floor a wall may start (WK-E021)", low=0)
    near_right_rad: float = setting(0.0175, "angles this close to 90 degrees are meant to be (WK-E033)", low=0)
    offset_min_m: float = setting(0.002, "collinear walls offset by less are in line (WK-E034)", low=0)
    offset_max_m: float = setting(0.03, "collinear walls offset by more are meant to be (WK-E034)", low=0)
    # E: scale
    scale_ratio: float = setting(100.0, "so many times the size of its peers is a wrong unit (WK-E040)", low=1)
    far_m: float = setting(1000.0, "coordinates beyond this are survey coordinates (WK-E042)", low=0)
    extent_min_m: float = setting(1.0, "a smaller map is suspicious (WK-E043)", low=0)
    extent_max_m: float = setting(500.0, "a larger map is suspicious (WK-E043)", low=0)
    # O
    leaf_m: float = setting(0.005, "how much larger than its hole a leaf may be (WK-O003, O004)", low=0)
    hole_m: float = setting(0.005, "how well boxes and declared opening must agree (WK-O001, O006)", low=0)
    swing_m2: float = setting(1e-4, "overlap of a swinging leaf that counts (WK-O010, O011); 1 cm2", low=0)
    sweep_steps: int = setting(32, "states at which a door's swing is looked at", low=4)
    clearance_m: float = setting(0.03, "chink beside a closed leaf through which a LiDAR sees (WK-O018)", low=0)
    passage_margin_m: float = setting(0.1, "room a robot wants beside itself in a door (WK-O020)", low=0)
    prior_sum: float = setting(1e-3, "how far from 1 a prior may sum up to (WK-O015)", low=0)
    # T
    passage_m: float = setting(0.03, "narrower ways do not join two regions (floods)", low=0)
    room_overlap_m: float = setting(0.05, "how far a room may reach into walls or other rooms (WK-T003)", low=0)
    room_area_share: float = setting(0.05, "how far a room's area may be off the flooded one (WK-T011)", low=0, high=1)
    # L
    plane_off_m: float = setting(0.05, "scan plane of map and calibration differ by more (WK-L002)", low=0)
    wobble_m: float = setting(0.05, "how far the scan plane may wander as the robot tilts (WK-L013)", low=0)
    ambiguous_warn: float = setting(0.1, "share of ambiguous poses that is a warning (WK-L003)", low=0, high=1)
    ambiguous_error: float = setting(0.5, "share of ambiguous poses that is an error (WK-L003)", low=0, high=1)
    degenerate_warn: float = setting(0.1, "share of poses with an open direction that is told (WK-L004)", low=0, high=1)
    glass_share: float = setting(0.3, "share of glass and mirror in the visible boundary (WK-L006)", low=0, high=1)
    movable_share: float = setting(0.2, "share of movable things in the visible boundary (WK-L009)", low=0, high=1)
    cue_share: float = setting(0.1, "share of poses that must see a class but wall (WK-L014)", low=0, high=1)
    beams: int = setting(72, "beams of a scan that poses are compared by (WK-L003)", low=8, high=240)
    cell_m: float = setting(0.05, "cell size of rasters made from the map (WK-L005, L011, L012)", low=1e-3)
    # P
    geometries: int = setting(1000, "more make other tools slow (WK-P008)", low=1)
    # A
    audit_shift_m: float = setting(0.02, "an element that is off by less is where it is drawn (WK-A003)", low=0)
    audit_unsupported_m: float = setting(0.5, "so much of a wall must be missing to be told (WK-A001)", low=0)
