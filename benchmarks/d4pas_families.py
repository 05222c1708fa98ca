"""What each family of D4PAS teaches: validity, label time, structure, and what needs no learning.

    python benchmarks/d4pas_families.py [FAMILY ...] [--count N] [--first SEED]

By family: members with faults; parts; processor time of a label; share solved and proven complete; orders; chance of a
random next part; parts with alternatives; states in which a part can be inserted that leads nowhere; Seq-Acc of a
random order, inside out, and the rule. Failures stay in the denominator of what is solved.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from sashimono.d4pas import heuristics
from sashimono.d4pas.clouds import normalised, part_clouds, unit_frame
from sashimono.d4pas.families import families
from sashimono.d4pas.labels import LabelConfig, label_assembly
from sashimono.d4pas.recipe import assembly_of, build_product, draw_recipe, find_faults
from sashimono.d4pas.states import insertable, is_right_order, random_state, right_next

HEAD = (
    "family           faults parts      label s med/p90/max     solved complete orders(med) chance alt dead "
    "random inside rule"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("families", nargs="*")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("-v", action="store_true", help="a line a member")
    options = parser.parse_args()
    print(HEAD)
    for name in options.families or families():
        print(report(name, range(options.first, options.first + options.count), options.v), flush=True)


def report(name: str, seeds: range, verbose: bool) -> str:
    """Return a family's line."""
    faults, rows = 0, []
    for seed in seeds:
        recipe = draw_recipe(name, seed)
        product = build_product(recipe)
        found = find_faults(product)
        if found:
            faults += 1
            print(f"  {recipe.id}: {'; '.join(found)[:300]}")
            continue
        row = measure(recipe, assembly_of(product, recipe))
        if verbose or row["stuck"]:
            print(f"  {recipe.id}: {row}")
        rows.append(row)
    if not rows:
        return f"{name:<16} {faults:>6}"

    def mean(key: str) -> float:
        return float(np.mean([row[key] for row in rows if row[key] is not None] or [np.nan]))

    parts, seconds = [row["parts"] for row in rows], [row["seconds"] for row in rows]
    return (
        f"{name:<16} {faults:>6} {min(parts):>2}-{np.median(parts):>4.0f}-{max(parts):>3} "
        f"{np.median(seconds):>6.2f} {np.quantile(seconds, 0.9):>6.2f} {max(seconds):>6.2f} "
        f"{mean('solved'):>9.2f} {mean('complete'):>8.2f} {np.median([row['orders'] or 0 for row in rows]):>10.3g} "
        f"{mean('chance'):>6.2f} {mean('alternatives'):>4.2f} {mean('dead'):>4.2f} "
        f"{mean('random'):>6.2f} {mean('inside'):>6.2f} {mean('rule'):>5.2f}"
    )


def measure(recipe, assembly) -> dict:
    start = time.process_time()
    label = label_assembly(assembly, config=LabelConfig(), seed=recipe.seed)
    seconds = time.process_time() - start
    row = {
        "parts": len(assembly),
        "seconds": round(seconds, 3),
        "solved": label.is_solved,
        "complete": label.is_complete,
    }
    row |= {"orders": label.orders, "stuck": [assembly.names[k] for k in label.stuck]}
    row |= {"cut": [assembly.names[k] for k in label.conditions.cut_short]}
    row |= dict.fromkeys(("chance", "alternatives", "dead", "random", "inside", "rule"))
    if not label.is_solved:
        return row
    masks, rng = label.conditions.masks, np.random.default_rng(recipe.seed)
    chances, dead = [], []
    for count in range(len(masks) - 1):
        state = random_state(masks, count, rng)
        right = right_next(masks, state)
        chances.append(right.bit_count() / (len(masks) - count))
        dead.append(insertable(masks, state) != right)
    clouds = part_clouds(assembly, 256, seed=recipe.seed)
    clouds = normalised(clouds, *unit_frame(clouds[..., :3]))
    row |= {
        "chance": float(np.mean(chances)),
        "alternatives": float(np.mean([len(clauses) > 1 for clauses in masks])),
        "dead": float(np.mean(dead)),
        "random": is_right_order(masks, heuristics.random_order(len(masks), rng)),
        "inside": is_right_order(masks, heuristics.inside_out(clouds)),
        "rule": is_right_order(masks, heuristics.by_clearance(clouds)),
    }
    return row


if __name__ == "__main__":
    main()
