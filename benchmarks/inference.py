"""Inference without PyTorch: time of a whole sequence, memory, and what a rigid motion of everything changes.

    python benchmarks/inference.py NETWORK [--data v1] [--split test] [--count 100]

Time is from clouds in place to the order with its probabilities, on two threads: features, both graphs, all steps.
"""

from __future__ import annotations

import argparse
import resource

import numpy as np

from sashimono import d4pas
from sashimono.d4pas.states import is_right_order
from sashimono.learning.infer import assembly_clouds, encode_clouds, infer, load_network, next_probabilities


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("network")
    parser.add_argument("--data", default="v1")
    parser.add_argument("--split", default="test")
    parser.add_argument("--count", type=int, default=100)
    options = parser.parse_args()
    network, rng = load_network(options.network), np.random.default_rng(0)
    times, parts, right, steps, changed = [], [], [], 0, 0
    chosen = [blueprint for blueprint in d4pas.load(options.data).split(options.split) if len(blueprint) > 2]
    for k in np.random.default_rng(0).permutation(len(chosen))[: options.count].tolist():
        blueprint = chosen[k]
        clouds = assembly_clouds(blueprint.assembly(), network.relations, seed=blueprint.seed)
        if not times:
            infer(blueprint.parts, clouds, network)  # compiles
        found = infer(blueprint.parts, clouds, network)
        order = [blueprint.parts.index(name) for name in found.order]
        right.append(is_right_order(blueprint.masks, order))
        times.append(found.sequence_milliseconds)
        parts.append(len(order))
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        turned = np.concatenate([clouds[..., :3] @ turn.T, clouds[..., 3:] @ turn.T], axis=2)
        said = [next_probabilities(encode_clouds(each, network), order, network)[:-1] for each in (clouds, turned)]
        steps += len(order) - 1
        changed += int((said[0].argmax(axis=1) != said[1].argmax(axis=1)).sum())
    print(f"{len(times)} blueprints of {np.median(parts):.0f} parts (median), Seq-Acc {np.mean(right):.3f}")
    print(f"sequence: median {np.median(times):.1f} ms, 90th percentile {np.quantile(times, 0.9):.1f} ms")
    print(f"turned: {changed / steps:.4f} of the choices in the same states differ")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
