"""A Segmentation -> the same with some masks grown or shrunk by a disc, to study what their quality is worth."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wallkit.core.segmentation import Segmentation
from wallkit.segment.class_map import ClassMap, mask_of


def grown(segmentation: Segmentation, roles: Collection[str], radius_px: float) -> ClassMap:
    """The class of every pixel, of which those near a mask's edge have changed sides.

    Args:
        roles: the classes that count as one of these make one mask.
        radius_px: pixels whose centre is at most so far from the mask's join it. Below 0: pixels of the mask at most so far
            from another class join that; pixels that nobody can tell, and the image's border, take nothing away.
            A pixel that changes sides takes class and confidence of the nearest one there.
    """
    from scipy.ndimage import distance_transform_edt

    height, width = segmentation.shape
    v, u = np.mgrid[:height, :width]
    labels, sure = segmentation.classes_at(np.stack([u.ravel(), v.ravel()], axis=1))
    ids, confidences = labels.reshape(height, width), sure.reshape(height, width)
    mask = mask_of(ids, segmentation.roles, roles)
    winner, loser = (mask, ~mask) if radius_px > 0 else (~mask & (ids >= 0), mask)
    if radius_px and winner.any():
        away, (rows, columns) = distance_transform_edt(~winner, return_indices=True)
        changed = loser & (away <= abs(radius_px))
        ids = np.where(changed, ids[rows, columns], ids)
        confidences = np.where(changed, confidences[rows, columns], confidences)
    return ClassMap(ids, segmentation.names, segmentation.roles, confidences)
