"""Transforms of a log -> T_ab between any two frames that are connected.

Static transforms hold at any time. Some robots publish fixed mounts again and again on /tf instead; a transform there
that never changes over the whole log is taken as static too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallkit.core.geometry import compose, interpolate_poses, invert, invert_matrix, pose_from_matrix
from wallkit.core.types import Float64Array, Int64Array, Transform
from wallkit.errors import LogError
from wallkit.logs.reader import Log

Pair = tuple[str, str]
# a fixed mount that is published with float32 rotations moves by less than this
_FIXED_TOLERANCE = 1e-4


class FrameTree:
    """Frames joined by fixed transforms; it need not be a tree, any path between two frames does."""

    def __init__(self, transforms: Iterable[Transform]) -> None:
        self._edges: dict[str, dict[str, Float64Array]] = {}
        for t in transforms:
            self._edges.setdefault(t.parent, {})[t.child] = t.matrix
            self._edges.setdefault(t.child, {})[t.parent] = invert_matrix(t.matrix)

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted(self._edges)

    def path(self, a: str, b: str) -> list[str] | None:
        """Frames from a to b, both included; None when they are not connected."""
        return shortest_path({f: list(near) for f, near in self._edges.items()}, a, b)

    def find(self, a: str, b: str) -> Float64Array | None:
        """(4, 4) T_ab; None when the frames are not connected."""
        path = self.path(a, b)
        if path is None:
            return None
        matrix = np.eye(4)
        for parent, child in pairwise(path):
            matrix = matrix @ self._edges[parent][child]
        return matrix

    def lookup(self, a: str, b: str) -> Float64Array:
        """(4, 4) T_ab.

        Raises:
            LogError: the frames are not connected; lists those that are known.
        """
        matrix = self.find(a, b)
        if matrix is None:
            known = ", ".join(self.frames) or "none"
            raise LogError(f"no transform between frames '{a}' and '{b}'", hint=f"known frames: {known}")
        return matrix


def shortest_path(edges: Mapping[str, Iterable[str]], a: str, b: str) -> list[str] | None:
    """Nodes from a to b in a graph, both included; None when they are not connected."""
    came_from: dict[str, str] = {a: a}
    queue = deque([a])
    while queue and b not in came_from:
        here = queue.popleft()
        for near in edges.get(here, ()):
            if near not in came_from:
                came_from[near] = here
                queue.append(near)
    if b not in came_from:
        return None
    path = [b]
    while path[-1] != a:
        path.append(came_from[path[-1]])
    return path[::-1]


@dataclass(frozen=True, slots=True)
class MovingTransforms:
    """Planar transforms over time: (parent, child) -> (stamps_ns (T,) ascending, T_parent_child poses (T, 3))."""

    links: Mapping[Pair, tuple[Int64Array, Float64Array]]

    def poses_at(self, a: str, b: str, stamps_ns: Int64Array) -> Float64Array:
        """(M, 3) T_ab at the wanted stamps, each link interpolated.

        Raises:
            LogError: the frames are not connected, or a link was not recorded at some of the stamps.
        """
        poses = np.zeros((len(stamps_ns), 3))
        for parent, child, is_forward in self._links_between(a, b):
            times, recorded = self.links[(parent, child)]
            if len(stamps_ns) and not times[0] <= stamps_ns.min() <= stamps_ns.max() <= times[-1]:
                raise LogError(f"the transform {parent}->{child} was not recorded at all of the wanted times")
            step = interpolate_poses(times, recorded, stamps_ns)
            poses = compose(poses, step if is_forward else invert(step))
        return poses

    def stamps_between(self, a: str, b: str) -> Int64Array:
        """Stamps of the most frequent link between two frames, while all the others were recorded too."""
        times = [self.links[(parent, child)][0] for parent, child, _ in self._links_between(a, b)]
        if not times:
            return np.zeros(0, dtype=np.int64)
        start, end = max(t[0] for t in times), min(t[-1] for t in times)
        densest = max(times, key=len)
        return np.asarray(densest[(densest >= start) & (densest <= end)])

    def _links_between(self, a: str, b: str) -> list[tuple[str, str, bool]]:
        edges: dict[str, list[str]] = {}
        for parent, child in self.links:
            edges.setdefault(parent, []).append(child)
            edges.setdefault(child, []).append(parent)
        path = shortest_path(edges, a, b)
        if path is None:
            known = ", ".join(f"{p}->{c}" for p, c in sorted(self.links)) or "none"
            raise LogError(f"no transform between frames '{a}' and '{b}'", hint=f"known transforms: {known}")
        steps = pairwise(path)
        return [(here, to, True) if (here, to) in self.links else (to, here, False) for here, to in steps]


def moving_transforms(log: Log, topics: Iterable[str]) -> MovingTransforms:
    """All transforms of the TF topics as planar poses over time, static ones joined in; repeated or older stamps left out.

    It holds 32 bytes for each transform of the log.
    """
    stamps: dict[Pair, list[int]] = {}
    poses: dict[Pair, list[Float64Array]] = {}
    for message in log.messages(set(topics)):
        for t in message.value if isinstance(message.value, tuple) else ():
            times = stamps.setdefault((t.parent, t.child), [])
            if not times or t.stamp_ns > times[-1]:
                times.append(t.stamp_ns)
                poses.setdefault((t.parent, t.child), []).append(pose_from_matrix(t.matrix))
    links = {pair: (np.array(times, dtype=np.int64), np.array(poses[pair])) for pair, times in stamps.items()}
    always = np.array([np.iinfo(np.int64).min // 4, np.iinfo(np.int64).max // 4])
    for t in log.static.transforms:
        links.setdefault((t.parent, t.child), (always, np.repeat(pose_from_matrix(t.matrix)[None], 2, axis=0)))
    return MovingTransforms(links)


def fixed_transforms(log: Log, topics: Iterable[str]) -> list[Transform]:
    """Transforms of the TF topics that are the same throughout the log."""
    first: dict[Pair, Transform] = {}
    moving: set[Pair] = set()
    for message in log.messages(set(topics)):
        for t in message.value if isinstance(message.value, tuple) else ():
            known = first.setdefault((t.parent, t.child), t)
            if np.abs(known.matrix - t.matrix).max() > _FIXED_TOLERANCE:
                moving.add((t.parent, t.child))
    return [t for pair, t in first.items() if pair not in moving]
