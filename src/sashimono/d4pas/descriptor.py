"""A geometry descriptor: numbers by which near-duplicates among products are told, whatever their seed or pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.d4pas.clouds import blueprint_cloud
from sashimono.geometry.mesh import measures

LARGEST = 8
"""Parts, the largest, whose sizes and places count one by one."""

SAMPLES = 8192
"""Surface points, so that where alike parts change places the histogram changes little."""

BINS = 8
"""Bins of the histogram of distances between surface points."""


def describe(assembly: Assembly) -> Float[np.ndarray, "number"]:
    """Return a product's descriptor, the same when the whole is moved, turned, scaled or its parts renumbered.

    Parts (log2 of their number); by part, the largest first: size (cube root of volume) and distance of the centre
    of mass from the whole's; a histogram of distances between surface points (D2, Osada et al., 2002). Lengths are
    over the root mean square radius of the surface.
    """
    masses = [measures.mass_properties(part.vertices_world, part.faces) for part in assembly.parts]
    roots = np.cbrt([mass.volume for mass in masses])
    middle = np.average([mass.center for mass in masses], axis=0, weights=[mass.volume for mass in masses])
    arms = np.array([np.linalg.norm(mass.center - middle) for mass in masses])
    unit = 1e-5 * roots.max()
    order = np.lexsort((np.round(arms / unit), -np.round(roots / unit)))
    # samples are drawn part by part, so that the order of the parts does not matter
    ranked = replace(assembly, parts=tuple(assembly.parts[k] for k in order), identical=())
    points = blueprint_cloud(ranked, SAMPLES, seed=0)[0][:, :3]
    scale = _radius(np.concatenate([part.vertices_world[part.faces] for part in assembly.parts]))
    order = order[:LARGEST]
    parts = np.zeros((2, LARGEST))
    parts[:, : len(order)] = roots[order] / scale, arms[order] / scale
    gaps = np.linalg.norm(points[: len(points) // 2] - points[len(points) // 2 :], axis=1) / scale
    histogram = np.histogram(gaps, bins=BINS, range=(0.0, 4.0))[0] / len(gaps)
    return np.concatenate([[np.log2(len(assembly))], parts.ravel(), histogram])


def _radius(corners: Float[np.ndarray, "face 3 3"]) -> float:
    """Root mean square distance of the surface from its centroid, exactly."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners - np.average(corners.mean(axis=1), axis=0, weights=areas)
    # of a triangle, the mean of |x|^2 is (|a|^2 + |b|^2 + |c|^2 + |a + b + c|^2) / 12
    squares = ((corners**2).sum(axis=(1, 2)) + (corners.sum(axis=1) ** 2).sum(axis=1)) / 12.0
    return float(np.sqrt(np.average(squares, weights=areas)))
