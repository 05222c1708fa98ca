"""Bookcases: shelves in level or sloping dados, a back panel under a pinned crown, a latched drawer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

GROOVE, PIN, BACK, REAR = 6.0, 6.0, 6.0, 10.0
"""Depth of dados and grooves, thickness of pins and of the back, what is behind the back [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one bookcase."""
    pick = kit.Draw(rng)
    slope = pick.choice((0.0, 12.0, 15.0, -12.0, -15.0), (3, 1, 1, 1, 1))
    return {
        "width": pick.length(90.0, 130.0),
        "depth": pick.length(54.0, 70.0),
        "board": pick.length(13.0, 16.0),
        "bay": pick.length(46.0, 52.0),
        "slope": slope,
        "shelves": [
            {
                "dowels": pick.choice(([], [1], [-1], [1, -1]), (1, 2, 2, 2)),
                "skew": pick.choice((0.0, 15.0, 25.0)),
                "stopped": pick.chance(0.3),
            }
            for _ in range(pick.count(2, 5))
        ],
        "back": pick.chance(0.75),
        "crown_pins": pick.choice(([1], [-1], [1, -1])),
        "crown_skew": pick.choice((0.0, 15.0, 30.0)),
        "drawer": slope == 0.0 and pick.chance(0.8),
        "latch": pick.choice((None, 0.0, 17.0, 25.0)),
        "divider": pick.chance(0.4),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the bookcase: its floor's top at z = 0, its back at y = 0, its front towards -y."""
    product, t, deep = Product(), params["board"], params["depth"]
    half = params["width"] / 2.0
    height = (len(params["shelves"]) + 1) * params["bay"]
    case = kit.box((-half, -deep, -t), (half, 0.0, height + t))
    case -= kit.box((t - half, -deep - 1.0, 0.0), (half - t, 1.0, height))
    product.add("case", case)
    for k, shelf in enumerate(params["shelves"]):
        _shelf(product, params, shelf, (k + 1) * params["bay"])
    if params["back"]:
        reach, gap = half - t + GROOVE, clearance(BACK, params["fit"]) / 2.0
        rear, front = -REAR, -REAR - BACK
        product.cut(["case"], kit.box((-reach - gap, front - gap, 0.0), (reach + gap, rear + gap, height + t + 5.0)))
        product.add("back", kit.box((-reach, front, 0.0), (reach, rear, height + t)))
    _crown(product, params, height + t)
    if params["drawer"]:
        _drawer(product, params, half - t)
    return product


def _shelf(product: Product, params: Mapping[str, Any], shelf: Mapping[str, Any], z: float) -> None:
    """Add a shelf about this level in its dados, which a stopped one cannot pass to the rear, and its dowels."""
    t, deep, fit = params["board"] - 2.0, params["depth"], params["fit"]
    inner, gap = params["width"] / 2.0 - params["board"], clearance(t, params["fit"]) / 2.0
    slope = params["slope"]
    rear = -1.0 - REAR - BACK
    run, middle = (deep + rear) / 2.0 - 4.0, (rear - deep) / 2.0
    end = run + gap if shelf["stopped"] else run + 90.0

    def put(solid: kit.Manifold) -> kit.Manifold:
        return solid.rotate((slope, 0.0, 0.0)).translate((0.0, middle, z))

    reach = inner + GROOVE
    product.cut(["case"], put(kit.box((-reach, -run - 90.0, -t / 2.0 - gap), (reach, end, t / 2.0 + gap))))
    name = product.add("shelf", put(kit.box((-reach, -run, -t / 2.0), (reach, run, t / 2.0))))
    hole = clearance(PIN, fit)
    for sign in shelf["dowels"]:
        lean = math.radians(shelf["skew"])
        axis = (sign * math.cos(lean), -math.sin(lean), 0.0)
        into = inner - 8.0
        outside = params["width"] / 2.0 - into
        origin = (sign * params["width"] / 2.0, middle - outside * math.tan(lean))
        rise = math.tan(math.radians(slope)) * (origin[1] - middle)
        origin = (origin[0], origin[1], z + 0.5 * rise)
        length = outside / math.cos(lean)
        kit.peg(product, ["case", name], PIN, length, origin, axis, clearance=hole, reach=9.0, part="dowel")


def _crown(product: Product, params: Mapping[str, Any], z: float) -> None:
    """Add the crown over the top and the back's slot; pins through its cheeks hold it."""
    half, deep, gap = params["width"] / 2.0, params["depth"], 0.1
    crown = kit.box((-half - 10.0, -deep - 4.0, z), (half + 10.0, 2.0, z + 8.0))
    for sign in (1, -1):
        low, high = sorted((sign * (half + gap), sign * (half + 10.0)))
        crown += kit.box((low, -deep - 4.0, z - 20.0), (high, 2.0, z + 1.0))
    crown = product.add("crown", crown)
    lean, hole = math.radians(params["crown_skew"]), clearance(PIN, params["fit"])
    for sign in params["crown_pins"]:
        axis = (sign * math.cos(lean), math.sin(lean), 0.0)
        origin = (sign * (half + 10.0), -0.6 * deep + 10.0 * math.tan(lean), z - 11.0)
        length = (10.0 + params["board"] - 4.0) / math.cos(lean)
        kit.peg(product, [crown, "case"], PIN, length, origin, axis, clearance=hole, reach=9.0)


def _drawer(product: Product, params: Mapping[str, Any], inner: float) -> None:
    """Add a drawer under ledges; a latch goes up through the floor into it, a divider drops into it."""
    deep, tall, t = params["depth"], 20.0, params["board"]
    half, end = inner - 0.2, -3.0 - REAR - BACK
    body = kit.box((-half, -deep, 0.0), (half, end, tall))
    body -= kit.box((7.0 - half, 9.0 - deep, 9.0), (half - 7.0, end - 6.0, tall + 5.0))
    body += kit.place(kit.cylinder(9.0, -1.0, 9.0, top=13.0), (0.4 * half, -deep, 0.5 * tall), (0.0, -1.0, 0.0))
    drawer = product.add("drawer", body)
    for sign in (1, -1):
        low, high = sorted((sign * (inner - 6.0), sign * (inner + 1.0)))
        product.join("case", kit.box((low, -deep, tall + 0.2), (high, -1.0 - REAR - BACK, tall + 5.2)))
    if params["latch"] is not None:
        lean, hole = math.radians(params["latch"]), clearance(PIN, params["fit"])
        axis, origin = (math.sin(lean), 0.0, -math.cos(lean)), (0.0, -0.55 * deep, -t)
        length = (t + 6.0) / math.cos(lean)
        kit.peg(product, [drawer, "case"], PIN, length, origin, axis, clearance=hole, reach=9.0, part="latch")
    if params["divider"]:
        x = -0.35 * half
        slot = kit.box((x - 2.5, 4.5 - deep, 9.0), (x + 2.5, end - 3.0, tall))
        product.cut([drawer], slot + slot.translate((0.0, 0.0, 1.0)))
        product.add("divider", slot)


FAMILY = Family(
    name="bookcase",
    version=2,
    summary="dowelled shelves slide out on a slope, to the rear too without the back; the crown holds the back",
    draw=draw,
    build=build,
)
