"""A map and the scans of a log -> what the log says about every element of the map; start here.

The scans and the map are fitted to each other first (`solve`): how far every face is off, how far the map as a whole,
and how far the poses. What is left over is looked at then: pieces that beams went through (`support`), returns near
nothing (`clusters`), and how the doors stood (`doors`). The rules WK-A put it into words.
"""

from __future__ import annotations

import numpy as np

from wallkit.maps.audit.clusters import clusters_of, unexplained_returns
from wallkit.maps.audit.doors import door_seen, doorways_at
from wallkit.maps.audit.faces import faces_at
from wallkit.maps.audit.nouns import Evidence, Logged
from wallkit.maps.audit.solve import fit
from wallkit.maps.audit.support import elements_seen, is_on_face, pieces_seen, places_seen
from wallkit.maps.model import SemanticMap

# a return this far off a face, or farther than its noise explains, is not from it
TOLERANCE_M = 0.12


def evidence_of(semantic_map: SemanticMap, logged: Logged, z_m: float, *, sigma_m: float) -> Evidence:
    """What a log says about a sound map.

    Args:
        z_m: height of the LiDAR above the floor. sigma_m: noise of a single return.

    Raises:
        MapError: nothing of the map is at that height.
    """
    faces = faces_at(semantic_map, z_m)
    doorways = doorways_at(semantic_map, z_m)
    solution = fit(faces, logged, sigma_m=sigma_m)
    moved = solution.logged
    tolerance_m = float(np.hypot(TOLERANCE_M, 3 * sigma_m))
    on_face = is_on_face(faces, moved, solution, tolerance_m=tolerance_m)
    pieces = pieces_seen(faces, moved, solution, on_face, tolerance_m=tolerance_m)
    swept = [doorway.swept for doorway in doorways]
    is_unexplained = unexplained_returns(faces, moved, solution, on_face, swept, tolerance_m=tolerance_m)
    is_return = np.isfinite(moved.ranges_m)
    return Evidence(
        source=semantic_map.source,
        poses=solution.poses,
        places=places_seen(solution),
        drift=solution.drift,
        elements=elements_seen(faces, solution, pieces),
        clusters=tuple(clusters_of(semantic_map, faces, moved, solution, is_unexplained)),
        doors={d.joint.name: door_seen(d, moved, solution, sigma_m=sigma_m) for d in doorways},
        pieces=pieces,
        explained=float(on_face.sum() / max(is_return.sum(), 1)),
    )
