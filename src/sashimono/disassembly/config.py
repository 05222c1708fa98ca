"""The options of level 1: what each stage may cost, and how contacts and conditions are looked at."""

from __future__ import annotations

from dataclasses import dataclass, field

from sashimono.disassembly.blocking.groups import LooseConfig
from sashimono.disassembly.blocking.relation import BlockingConfig
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.placed_parts import PlacedPartsConfig
from sashimono.disassembly.shared_bodies import SharedConfig
from sashimono.disassembly.threads.declared import DeclareConfig
from sashimono.disassembly.threads.surface import UnscrewConfig
from sashimono.disassembly.tilting.search import TiltConfig
from sashimono.disassembly.translation.leaning import LeaningConfig
from sashimono.disassembly.translation.search import TranslationConfig
from sashimono.disassembly.translation.simultaneous import SimultaneousConfig


@dataclass(frozen=True, kw_only=True)
class SeparateConfig:
    """Budgets and tolerances of the cascade; the depths that motions may reach are in ``parts.tolerances``."""

    parts: PlacedPartsConfig = field(default_factory=PlacedPartsConfig)
    blocking: BlockingConfig = field(default_factory=BlockingConfig)
    translation: TranslationConfig = field(default_factory=TranslationConfig)
    leaning: LeaningConfig = field(default_factory=LeaningConfig)
    loose: LooseConfig = field(default_factory=LooseConfig)
    simultaneous: SimultaneousConfig = field(default_factory=SimultaneousConfig)
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    tilt: TiltConfig = field(default_factory=TiltConfig)
    tilting: bool = False
    """Whether tilting is asked, last of all: it takes seconds for each part that it does not free. Plans ask it."""
    unscrew: UnscrewConfig = field(default_factory=UnscrewConfig)
    max_traced: int = 40_000_000
    """Tracing steps that threads, physics and tilting may take in one run (an order, or conditions): about half a
    minute."""
    shared: SharedConfig = field(default_factory=SharedConfig)
    declare: DeclareConfig = field(default_factory=DeclareConfig)
    contact_gap: float = 0.01
    """Surfaces nearer than this share of the smaller part's extent touch."""
    proof_gap: float = 0.0025
    """The same, where contacts are to tell which parts hold one."""
    escape_samples: int = 2000
    """Directions looked at when a way out is read off the contacts."""
    max_queries: int = 64
    """Sets of obstacles that the later stages are asked about for one part's removal conditions, the largest first:
    1, only all other parts; 0, none. Where more would have been asked, the conditions say that they were cut short."""
    max_unproven: int = 4
    """The same for sets of which neither a motion nor a proof is found: each costs a whole search."""
    max_undecided: int = 1000
    """Sets of obstacles waiting to be asked, for one part, at once; beyond, too, they are cut short."""
    proof_margin: float = 0.1
    """Sine of the angle by which every direction must run into a touching surface for a proof that the touching
    parts allow no translation to be looked for first; covers the spacing of the directions looked at."""
