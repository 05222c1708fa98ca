"""A geometry descriptor: numbers by which near-duplicates among products are told, whatever their seed or pose."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.d4pas.clouds import blueprint_cloud
from sashimono.geometry import mesh

LARGEST = 8
"""Parts, the largest, whose sizes and places count one by one."""

BINS = 8
"""Bins of the histogram of distances between surface points."""


def describe(assembly: Assembly) -> Float[np.ndarray, "number"]:
    """Return a product's descriptor, the same when the whole is moved, turned, scaled or its parts renumbered.

    Parts (log2 of their number); by part, the largest first: size (cube root of volume) and distance of the centre
    of mass from the whole's; a histogram of distances between surface points (D2, Osada et al., 2002). Lengths are
    over the root mean square radius of the surface.
    """
    cloud, _ = blueprint_cloud(assembly, 2048, seed=0)
    points = cloud[:, :3] - cloud[:, :3].mean(axis=0)
    scale = float(np.sqrt((points**2).sum(axis=1).mean()))
    masses = [mesh.mass_properties(part.vertices_world, part.faces) for part in assembly.parts]
    sizes = np.cbrt([mass.volume for mass in masses]) / scale
    middle = np.average([mass.center for mass in masses], axis=0, weights=[mass.volume for mass in masses])
    arms = np.array([np.linalg.norm(mass.center - middle) for mass in masses]) / scale
    order = np.lexsort((np.round(arms, 6), -np.round(sizes, 6)))[:LARGEST]
    parts = np.zeros((2, LARGEST))
    parts[:, : len(order)] = sizes[order], arms[order]
    gaps = np.linalg.norm(points[: len(points) // 2] - points[len(points) // 2 :], axis=1) / scale
    histogram = np.histogram(gaps, bins=BINS, range=(0.0, 4.0))[0] / len(gaps)
    return np.concatenate([[np.log2(len(assembly))], parts.ravel(), histogram])
