"""Fits that a plan declares: is each of two parts that could give so much, and how deep may the pair go then?

Which part gives, and why, is the planner's word. What is checked is that it cannot declare everything away. A pair
gives a share of the smaller part's size. A part that is thin in itself (a ring, a spring, a formed sheet) gives about
as much as it is thick. That neither slips through the other is looked at where they move (`piercing`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from sashimono.plan import DeclaredFit
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig


def fit_problems(fits: Sequence[DeclaredFit], bodies: Mapping[str, SampledBody], config: VerifyConfig) -> list[str]:
    """Return what is wrong with the fits that a plan declares; nothing if they can be."""
    problems, seen = [], set()
    for fit in fits:
        name = " and ".join(fit.parts)
        unknown = [part for part in fit.parts if part not in bodies]
        if len(set(fit.parts)) != 2:
            problems.append(f"a fit of {name} is declared: it must be of two parts")
        elif unknown:
            problems.append(f"a fit of {name} is declared, but {unknown[0]!r} is not in the assembly")
        elif frozenset(fit.parts) in seen:
            problems.append(f"the fit of {name} is declared more than once")
        elif not (np.isfinite(fit.depth) and fit.depth > 0.0):
            problems.append(f"the fit of {name} has no positive depth")
        else:
            most = largest_fit(bodies[fit.parts[0]], bodies[fit.parts[1]], config)
            if fit.depth > most:
                problems.append(
                    f"the fit of {name} is declared {fit.depth * 1e3:.4g} mm deep: parts of these sizes can give"
                    f" {most * 1e3:.4g} mm at most"
                )
        seen.add(frozenset(fit.parts))
    return problems


def largest_fit(first: SampledBody, second: SampledBody, config: VerifyConfig) -> float:
    """Return the depth that a declared fit of two parts may have at most [m]."""
    give = config.relative_fit * min(first.smallest_extent, second.smallest_extent)
    return max(give, _thin_give(first, config), _thin_give(second, config))


def _thin_give(body: SampledBody, config: VerifyConfig) -> float:
    """What a part that is thin in itself gives [m]; 0 for any other.

    Twice its volume over its surface is the thickness of a sheet, and half that of a round wire. It is thin if this is
    small beside the part's middle extent, and if the part leaves much of its convex hull empty: a plate does not.
    """
    triangles = body.vertices[body.faces]
    area = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    thickness = 2.0 * body.volume / float(area.sum())
    middle = _middle_extent(body)
    try:
        hull = float(ConvexHull(body.vertices).volume)
    except QhullError:
        return 0.0
    if thickness > config.thin_fit * middle or body.volume > config.hollow_fit * hull:
        return 0.0
    return min(config.give_thickness * thickness, config.give_extent * middle)


def _middle_extent(body: SampledBody) -> float:
    """The middle one of the extents along the principal axes of the vertices [m]."""
    centred = body.vertices - body.vertices.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    return float(np.sort(np.ptp(centred @ axes.T, axis=0))[1])
