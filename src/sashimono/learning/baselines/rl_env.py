"""Assembly sequences as a Gymnasium environment, ``sashimono/AssemblySequence-v0``; needs the extra ``rl``.

Importing this module registers it; so does ``gymnasium.make`` with the module's name before the environment's:

>>> import gymnasium
>>> env = gymnasium.make(
...     "sashimono.learning.baselines.rl_env:sashimono/AssemblySequence-v0", data="v1", cache="clouds", retries=3
... )

**Observation**, a dictionary; M is the number of slots for parts:

- ``blueprint`` (point, 6): points of the whole with normals, in the unit ball;
- ``parts`` (M, point, 6): points of each part in place, in the same frame; zero in slots without a part;
- ``axes`` (M, 6, 3): unit vectors of the signed inertia axes, along which a part would move as it goes in;
- ``placed``, ``remaining`` (M,): 1 for parts that are placed, and that are not; a slot without a part is neither;
- ``tried`` (M, 6): 1 for the steps that turned out wrong since the last part was placed.

**Action**: ``6 * part + axis``. No action is masked. Whether it is right is exact, see
`sashimono.learning.baselines.episode`; a slot without a part and a placed part are wrong.

**Reward**: 1 for a right step, 5 more for the last one, -1 for a wrong step.

**End**: terminated when all parts are placed, or at a wrong step once ``retries`` wrong steps are spent; with 0, the
strict game, at the first one. A wrong step moves nothing. Nothing is truncated.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from sashimono.errors import InputError
from sashimono.learning.baselines.episode import Bench, Episode, bench_of, padded_clouds, placed_rows
from sashimono.learning.baselines.ways import AXES
from sashimono.learning.cloud_cache import CloudCache, Dataset

ID = "sashimono/AssemblySequence-v0"


class AssemblySequence(gymnasium.Env[dict[str, np.ndarray], np.int64]):
    """Products to put together, drawn at random; see the module."""

    metadata = {"render_modes": ["ansi"], "render_fps": 1}  # noqa: RUF012 (as Gymnasium has it)

    def __init__(
        self,
        *,
        bench: Bench | None = None,
        data: Dataset | str = "v1",
        cache: CloudCache | Path | str | None = None,
        split: str = "train",
        limit: int | None = None,
        slots: int | None = None,
        points: int = 64,
        target_points: int = 128,
        retries: int = 0,
        episodes: int = 1,
        render_mode: str | None = None,
    ) -> None:
        """Take in the blueprints.

        Args:
            bench: The blueprints with all that is known of them; the next four say how to make it if there is none.
            data: A dataset, its name or its folder.
            cache: Its clouds, or the folder where they are or are to be made.
            split: Split of the dataset.
            limit: Only so many blueprints, over all families.
            slots: M; as many as the largest blueprint has parts, if None.
            points: Points of each part.
            target_points: Points of each blueprint.
            retries: Wrong steps that an episode survives.
            episodes: Episodes in a row with the same blueprint.
            render_mode: ``ansi``: `render` returns a line of text.

        Raises InputError if there is no bench and no cache, or a blueprint has more parts than there are slots.
        """
        if bench is None:
            if cache is None:
                raise InputError("the environment needs a cache of clouds: give cache=FOLDER")
            bench = bench_of(data, cache, split=split, limit=limit)
        self.bench = bench
        self.slots = bench.most_parts if slots is None else slots
        if bench.most_parts > self.slots:
            raise InputError(f"a blueprint has {bench.most_parts} parts, and there are {self.slots} slots")
        self.points, self.target_points = points, target_points
        self.retries, self.episodes = retries, episodes
        self.render_mode = render_mode

        def box(*shape: int) -> spaces.Box:
            return spaces.Box(-2.0, 2.0, shape, np.float32)

        self.observation_space: spaces.Space[Any] = spaces.Dict(
            {
                "blueprint": box(target_points, 6),
                "parts": box(self.slots, points, 6),
                "axes": box(self.slots, AXES, 3),
                "placed": spaces.MultiBinary(self.slots),
                "remaining": spaces.MultiBinary(self.slots),
                "tried": spaces.MultiBinary((self.slots, AXES)),
            }
        )
        self.action_space = spaces.Discrete(self.slots * AXES)
        self._row = int(bench.rows[0])
        self._left = 0
        self._seen: dict[str, np.ndarray] = {}
        self._episode = Episode(bench.masks[self._row], bench.ways[self._row], retries=retries)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin with the next product, and return what is seen of it.

        ``options={"blueprint": id}`` says which one. Raises InputError if the bench has none of that id.
        """
        super().reset(seed=seed)
        asked = (options or {}).get("blueprint")
        if asked is not None:
            self._begin(self._row_of(asked))
            self._left = 0
        elif seed is not None or self._left <= 0:
            self._begin(int(self.bench.rows[self.np_random.integers(len(self.bench.rows))]))
            self._left = self.episodes - 1
        else:
            self._left -= 1
        self._episode = Episode(self.bench.masks[self._row], self.bench.ways[self._row], retries=self.retries)
        return self._observation(), self._info()

    def step(self, action: np.int64 | int) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Take a step; return observation, reward, whether the episode is over, False, and what is known besides.

        ``info`` has the blueprint's ``id``, ``right`` of this step, the ``order`` of the placed parts, ``wrong`` steps
        so far and, once it is over, ``is_success``: whether all parts are placed.
        """
        part, axis = divmod(int(action), AXES)
        before = self._episode.wrong
        reward = self._episode.step(part, axis)
        info = self._info() | {"right": self._episode.wrong == before}
        return self._observation(), reward, self._episode.is_over, False, info

    def render(self) -> str | None:  # type: ignore[override]
        """Return one line: the blueprint, the order so far, the wrong steps."""
        if self.render_mode is None:
            return None
        done = " ".join(map(str, self._episode.order))
        return f"{self.bench.cache.ids[self._row]}: placed [{done}], wrong {self._episode.wrong}"

    def _begin(self, row: int) -> None:
        self._row = row
        self._seen = padded_clouds(self.bench, row, self.slots, self.points, self.target_points)

    def _row_of(self, name: str) -> int:
        for row in self.bench.rows.tolist():
            if self.bench.cache.ids[row] == name:
                return row
        raise InputError(f"no blueprint {name!r} on the bench")

    def _observation(self) -> dict[str, np.ndarray]:
        count = int(self.bench.cache.counts[self._row])
        placed = placed_rows(np.array(self._episode.placed), self.slots)
        tried = np.zeros((self.slots, AXES), dtype=np.int8)
        tried[:count] = self._episode.tried
        remaining = (1 - placed) * (np.arange(self.slots) < count)
        seen = {name: array.copy() for name, array in self._seen.items()}  # users may keep, and change, what they get
        return {**seen, "placed": placed, "remaining": remaining.astype(np.int8), "tried": tried}

    def _info(self) -> dict[str, Any]:
        episode = self._episode
        info: dict[str, Any] = {
            "id": self.bench.cache.ids[self._row],
            "order": tuple(episode.order),
            "wrong": episode.wrong,
        }
        return info | ({"is_success": episode.is_whole} if episode.is_over else {})


gymnasium.register(id=ID, entry_point=f"{__name__}:AssemblySequence")
