"""A toy dataset for tests of learning: blocks of different sizes in a tube with a floor, labelled by construction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sashimono.assembly import Assembly, Part

BOX_FACES = np.array(
    [
        [0, 2, 1],
        [0, 3, 2],
        [4, 5, 6],
        [4, 6, 7],
        [0, 1, 5],
        [0, 5, 4],
        [1, 2, 6],
        [1, 6, 5],
        [2, 3, 7],
        [2, 7, 6],
        [3, 0, 4],
        [3, 4, 7],
    ]
)


@dataclass(frozen=True, kw_only=True)
class ToyBlueprint:
    """A pile of blocks; a block leaves when those above it have left, the lowest is placed first."""

    seed: int
    blocks: int
    split: str = "train"
    family: str = "pile"
    complete: bool = True
    order: tuple[int, ...] = ()
    """Blocks from the lowest to the highest, by part index."""

    @property
    def id(self) -> str:
        return f"{self.family}-{self.seed:06d}"

    @property
    def parts(self) -> tuple[str, ...]:
        return tuple(f"block_{k}" for k in range(self.blocks))

    @property
    def masks(self) -> tuple[tuple[int, ...], ...]:
        above, out = 0, [()] * self.blocks
        for part in reversed(self.order):
            out[part] = (above,)
            above |= 1 << part
        return tuple(out)

    @property
    def identical(self) -> tuple[tuple[int, ...], ...]:
        return ()

    @property
    def sequences(self) -> tuple[tuple[int, ...], ...]:
        return (self.order,)

    def assembly(self) -> Assembly:
        rng = np.random.default_rng([self.seed, 1])
        heights = rng.uniform(0.3, 1.0, self.blocks)
        widths = np.linspace(1.0, 0.3, self.blocks) * rng.uniform(0.9, 1.1)
        corners = np.array(
            [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
        )
        parts, bottom = {}, 0.0
        for k, part in enumerate(self.order):
            size = np.array([0.5 * widths[k], 0.5 * widths[k], heights[k]])
            parts[part] = Part(
                name=f"block_{part}",
                vertices_part=corners * size + [0.0, 0.0, bottom],
                faces=BOX_FACES,
                T_world_part=np.eye(4),
            )
            bottom += heights[k]
        return Assembly(parts=tuple(parts[k] for k in range(self.blocks)))


@dataclass(frozen=True, kw_only=True)
class ToyDataset:
    """Some piles."""

    blueprints: tuple[ToyBlueprint, ...]
    hash: str = "toy"

    def __getitem__(self, name: str) -> ToyBlueprint:
        return next(blueprint for blueprint in self.blueprints if blueprint.id == name)

    def split(self, name: str) -> tuple[ToyBlueprint, ...]:
        return tuple(blueprint for blueprint in self.blueprints if blueprint.split == name)


def toy_dataset(count: int = 8, *, least: int = 3, most: int = 5) -> ToyDataset:
    """Return so many piles: three in four to train on, the rest to validate."""
    blueprints = []
    for seed in range(count):
        blocks = least + seed % (most - least + 1)
        order = tuple(int(k) for k in np.random.default_rng(seed).permutation(blocks))
        split = "val" if seed % 4 == 3 else "train"
        blueprints.append(ToyBlueprint(seed=seed, blocks=blocks, split=split, order=order))
    return ToyDataset(blueprints=tuple(blueprints))
