"""The stage of translations: one along a direction read off the contacts, several in a row, or a proof of "no"."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_removal
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.translation.contact_normals import ContactNormals, escape_directions, immobile_margin
from sashimono.disassembly.translation.leaning import LeaningConfig, leaning_direction
from sashimono.disassembly.translation.search import TranslationResult, TranslationSearch
from sashimono.plan import Answer, MotionClass


class TranslationStage:
    """Any translations of one part: a motion, the proof that there is none, or neither."""

    name = "translation"
    motions = MotionClass.TRANSLATIONS

    def __init__(
        self,
        parts: PlacedParts,
        contacts: ContactNormals,
        search: TranslationSearch,
        *,
        touching: ContactNormals,
        leaning: LeaningConfig,
        escape_samples: int,
        proof_margin: float,
    ) -> None:
        """Take in the parts, the contacts that may hold a part, the search, and its options.

        Args:
            parts: The placed parts.
            contacts: Which parts touch, as a proof needs it.
            search: Of several translations in a row.
            touching: What touches, by a wider gap: it tells where a way out may lead.
            leaning: How directions are improved where all else fails.
            escape_samples: As in `SeparateConfig`.
            proof_margin: As in `SeparateConfig`.
        """
        self.parts, self.contacts, self.search = parts, contacts, search
        self.touching, self.leaning = touching, leaning
        self.escape_samples, self.proof_margin = escape_samples, proof_margin
        self._known_passes: dict[tuple[int, int, bytes], bool] = {}

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        others = remaining & ~(1 << part)
        contacts = self.contacts.of(part, others, samples=self.escape_samples)
        directions, margin = escape_directions(contacts, samples=self.escape_samples)
        for direction in directions:
            if all(self._passes(part, direction, other) for other in bits(others)):
                removal = self.parts.straight_removal(1 << part, others, direction)
                return self._free(part, remaining, removal, stage="contacts")
        if margin < -self.proof_margin:
            # a ridge lower than the tolerance touches too: this is a hint where a proof is to be had
            needed = immobile_margin(contacts, margin=self.proof_margin)
            caged = self.search.caged(part, needed)
            if caged.proven:
                return self._blocked(caged, stage="contacts")
        found = self.search.search(part, bits(others))
        if found.removal is not None:
            return self._free(part, remaining, found.removal, stage=self.name)
        if not found.proven:
            direction = self._leaning(part, bits(others))
            if direction is not None:
                removal = self.parts.straight_removal(1 << part, others, direction)
                return self._free(part, remaining, removal, stage=self.name)
        return self._blocked(found, stage=self.name)

    def _passes(self, part: int, direction: Float[np.ndarray, "3"], other: int) -> bool:
        """Whether the part goes straight out past one other; the same directions come back for other sets of parts."""
        key = (part, other, direction.tobytes())
        if key not in self._known_passes:
            self._known_passes[key] = passes(self.parts, part, np.zeros(3), direction, other)
        return self._known_passes[key]

    def _leaning(self, part: int, others: list[int]) -> Float[np.ndarray, "3"] | None:
        """A straight way out near to a line of the part, or to where its contacts let it go most."""
        margins = self.touching.of(part, sum(1 << other for other in others), samples=self.escape_samples)
        lines = self.parts.part_lines[part]
        clear = escape_directions(margins, samples=self.escape_samples, least=-1.0)[0]
        given = np.concatenate([clear, lines, -lines])
        return leaning_direction(self.parts, part, others, given, config=self.leaning)

    def fewer_holders(self, part: int, holders: int, *, frees: Callable[[int], bool]) -> int:
        """Return a smaller set of parts that provably hold a part, out of one that does; the same if none is proven.

        Args:
            part: The part that is held.
            holders: Mask of the parts that hold it, as was proven.
            frees: Whether a set of parts is known to let the part go: such a set is not looked at.
        """
        for other in reversed(bits(holders)):
            rest = holders & ~(1 << other)
            if rest and rest != holders and not frees(rest):
                found = self.search.caged(part, bits(rest))
                if found.proven:
                    holders = sum(1 << k for k in found.blocked_by)
        return holders

    def can_recall(self, found: Separation) -> bool:
        return True

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        holders = sum(1 << k for k in said.blocked_by)
        return holders & ~others == 0 and (said.proven_for is not None or others & ~asked == 0)

    def _free(self, part: int, remaining: int, removal: Removal, *, stage: str) -> Separation:
        absent = bits(self.parts.all_parts & ~remaining)
        hits = hit_by_removal(self.parts, part, removal, absent)
        return Separation(answer=Answer.FREE, removal=removal, hits=hits, stage=stage)

    def _blocked(self, found: TranslationResult, *, stage: str) -> Separation:
        return Separation(
            answer=Answer.PROVEN_BLOCKED if found.proven else Answer.UNKNOWN,
            proven_for=self.motions if found.proven else None,
            stage=stage,
            blocked_by=found.blocked_by,
            reason=found.reason,
        )
