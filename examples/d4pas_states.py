"""Draw a blueprint of a dataset: its order, and which parts are right next in a state halfway.

python examples/d4pas_states.py [DATASET] [--id ID] [--out picture.png]      (needs the extras `dataset` and `render`)

In the right picture grey parts are placed. Of the others, green ones are right next (y = 1), orange ones can be put in
now but lead nowhere, and red ones cannot be put in yet.
"""

from __future__ import annotations

import argparse
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from sashimono.d4pas import clouds, states
from sashimono.d4pas.dataset import Blueprint, load
from sashimono.d4pas.exploded import explosion
from sashimono.d4pas.render import RenderConfig, render
from sashimono.d4pas.sheets import SheetConfig, entry_of, order_picture
from sashimono.raster.colors import to_linear

PLACED, RIGHT, LEADS_NOWHERE, NOT_YET = np.array(
    [[0.76, 0.78, 0.81], [0.36, 0.70, 0.44], [0.93, 0.62, 0.25], [0.83, 0.36, 0.36]]
)


def telling_state(blueprint: Blueprint, rng: np.random.Generator) -> int:
    """Return a reachable state about halfway, if possible one in which a part can be put in but leads nowhere."""
    drawn = [blueprint.random_state(max(1, len(blueprint) // 2), rng) for _ in range(50)]
    masks = blueprint.masks
    return max(drawn, key=lambda placed: states.insertable(masks, placed) & ~states.right_next(masks, placed) != 0)


def main() -> None:
    """Read the command line and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", nargs="?", default="v1", help="a dataset's folder, or v1")
    parser.add_argument("--id", help="the blueprint; else the first one")
    parser.add_argument("--out", type=Path, default=Path("states.png"))
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")

    data = load(options.dataset)
    blueprint = data[options.id or 0]
    placed = telling_state(blueprint, np.random.default_rng(0))
    right, now = blueprint.state(placed), states.insertable(blueprint.masks, placed)
    y = [right >> part & 1 for part in range(len(blueprint)) if not placed >> part & 1]
    part_clouds = clouds.part_clouds(blueprint.assembly(), 512)  # what a network would see: (part, 512, 6)
    logging.info("%s: %d parts, %s orders", blueprint.id, len(blueprint), blueprint.orders)
    logging.info("clouds %s, y of the %d parts left: %s", part_clouds.shape, len(y), y)

    picture = RenderConfig(width=640, height=560, azimuth=-1.0)
    entry = replace(entry_of(blueprint, data.steps.get(blueprint.id, [])), title="", note="")
    left = order_picture(entry, config=SheetConfig(picture=picture))
    # the order with the placed parts first: the others are drawn away from them
    order = sorted(entry.order, key=lambda part: not placed >> part & 1)
    moves = explosion(entry.assembly, order, entry.ways_out, share=0.8)
    colors = np.empty((len(blueprint), 3))
    for part in range(len(blueprint)):
        if placed >> part & 1:
            colors[part], moves[part] = PLACED, 0.0
        else:
            colors[part] = RIGHT if right >> part & 1 else LEADS_NOWHERE if now >> part & 1 else NOT_YET
    state = Image.fromarray(render(entry.assembly, to_linear(colors), offsets=moves, config=picture).pixels)
    page = Image.new("RGB", (2 * picture.width, picture.height), "white")
    page.paste(left, (0, 0))
    page.paste(state, (picture.width, 0))
    page.save(options.out)
    logging.info("wrote %s", options.out)


if __name__ == "__main__":
    main()
