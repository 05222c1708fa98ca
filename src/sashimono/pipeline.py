"""The three levels composed: sequence, motion, contact, and the independent check at the end."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from typing import Literal

import numpy as np

from sashimono import __version__
from sashimono.assembly import Assembly, Source, few_words
from sashimono.bodies import make_bodies
from sashimono.contact import ContactConfig, Executability, Gripper, named_gripper, real_tool
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import REFUSED, SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.nested import TakenApart, take_apart_by_products
from sashimono.disassembly.sequence.order import Orderer
from sashimono.disassembly.sequence.products import Products
from sashimono.errors import SashimonoError
from sashimono.fits.config import FitConfig
from sashimono.fits.find import FitFinder, find_fits, planned_depths
from sashimono.geometry.body import Body, SampleConfig
from sashimono.geometry.mesh.measures import smallest_extent
from sashimono.motion import MotionConfig
from sashimono.plan import (
    Answer,
    AssemblyPlan,
    DeclaredFit,
    Motion,
    PlannedProduct,
    RestingPoses,
    Step,
    Table,
    Unsolved,
    placed_parts,
)
from sashimono.stability import StabilityConfig, hold_plan
from sashimono.tree import Progress, TreePlanner
from sashimono.verify import StepReport, Verifier, VerifyConfig

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class PipelineConfig:
    """Options of every level, and how often they go back to one another."""

    method: Literal["cascade", "physics", "past"] = "cascade"
    """How removals are found: the cascade; the paper's Algorithm 1; or the cascade, asked first in the order that the
    learned network proposes."""
    network: str = "past-posed"
    """The network of the method ``past``: a shipped one, or a folder."""
    algorithm1: Algorithm1Config = field(default_factory=Algorithm1Config)
    """Options of the method ``physics``."""
    executable: bool = True
    """Whether the method ``physics`` takes a part out only if a grasp for it exists (``isExec``)."""
    samples: SampleConfig = field(default_factory=SampleConfig)
    separate: SeparateConfig = field(default_factory=lambda: SeparateConfig(tilting=True))
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    fits: FitConfig = field(default_factory=FitConfig)
    """Which fits are declared where, with all parts rigid, some part has no motion; not by method ``physics``."""
    motion: MotionConfig = field(default_factory=MotionConfig)
    contact: ContactConfig = field(default_factory=ContactConfig)
    verify: VerifyConfig = field(default_factory=VerifyConfig)
    gripper: str | Gripper = "fingertips"
    """``fingertips``: two balls at the contact points, as in the paper; a preset's name; ``auto``: generic jaws in
    proportion to each part; or a gripper."""
    grippers: tuple[str | Gripper, ...] = ()
    """Grippers of which each step says whether they can take the part all the way."""
    contacts: bool = True
    """Whether level 3 runs."""
    stability: StabilityConfig = field(default_factory=StabilityConfig)
    """Options of support and gravity."""
    hands: int = 2
    """How many hands there are; a plan in which a step takes more is not executable."""
    explain_order: bool = False
    """Whether each step says what else could have come, and why it did not; by method ``cascade`` only."""
    max_attempts: int = 6
    """Most sequences that are tried, the first two of them in the order that is searched for. Where a motion fails or
    is refuted, the next one does without that direction."""
    contact_attempts: int = 3
    """Of these, sequences tried for the sake of contacts alone: every motion holds, but for some step there is no
    contact, so that its departure is refused in the next. The plan with most parts, then with most contacts, is taken.
    """


def plan_assembly(
    assembly: Assembly,
    *,
    config: PipelineConfig | None = None,
    seed: int = 0,
    resting: RestingPoses | None = None,
    progress: Progress = lambda stage, done, total: None,
) -> AssemblyPlan:
    """Plan an assembly: an order, a motion and a contact for each part, checked independently.

    The plan is ``complete`` only if every part has a motion and `Verifier.check` found nothing wrong;
    otherwise it is ``partial`` and says of each missing part what is known. The same seed gives the
    same plan, timings apart.

    Args:
        assembly: Parts in assembled poses.
        config: Options of every level.
        seed: Of every random choice.
        resting: Table and resting poses from elsewhere, each standing by itself; of a subassembly, the pose of the part
            whose name stands for it. Parts that it does not name are laid out beside them.
        progress: Called with (stage, done, total).

    Raises:
        SashimonoError: A gripper is not known, or a resting pose is of no part.
    """
    config = config or PipelineConfig()
    if unknown := sorted(set() if resting is None else set(resting.poses) - set(assembly.names)):
        raise SashimonoError(
            f"{unknown[0]!r} has a resting pose, but is no part. Parts are: {', '.join(assembly.names)}."
        )
    named_gripper(config.gripper)
    for tool in config.grippers:
        real_tool(tool)
    clock = _Clock()
    rng_bodies, _, _ = np.random.default_rng(seed).spawn(3)
    with clock.stage("sequence"):
        bodies = make_bodies(assembly, config=config.samples, rng=rng_bodies)
        cascade = Cascade(assembly, bodies, config=config.separate)
        sequence = replace(config.sequence, cost=replace(config.sequence.cost, hands=config.hands))
        orderer = Orderer(cascade, bodies, config=sequence, stability=config.stability)
    planner = TreePlanner(
        assembly=assembly,
        bodies=bodies,
        motion=config.motion,
        contact=config.contact if config.contacts else None,
        gripper=config.gripper,
        report=config.grippers,
        samples=config.samples,
        resting=resting,
        stage=clock.stage,
    )
    with clock.stage("verify"):
        verifier = Verifier(assembly, config=config.verify)
    products = Products()
    if config.method == "cascade" and config.sequence.products.enabled and assembly.products:
        with clock.stage("sequence"):
            products = orderer.products
    finder = FitFinder(cascade.parts, config=config.fits)
    bent: dict[tuple[DeclaredFit, ...], tuple[_Attempt, Orderer]] = {}

    def bend(found: DisassemblyResult, unsolved: Sequence[str] = ()) -> tuple[_Attempt, Orderer] | None:
        """The best plan with the fits with which what is left over may come apart; None if there are none."""
        with clock.stage("fits"):
            fits = find_fits(finder, assembly, found, unsolved)
        if fits and fits not in bent:
            giving = cascade.with_fits(planned_depths(assembly, fits, config=config.fits))
            bending = Orderer(giving, bodies, config=sequence, stability=config.stability)
            known = _best_attempt(planner, verifier, giving, bending, products, config, seed, progress, fits=fits)
            bent[fits] = known, bending
        return bent.get(fits)

    def counted(done: int) -> None:
        progress("sequence", done, len(assembly) - 1)

    may_bend = config.fits.enabled and config.method != "physics"
    first, with_fits = None, None
    if may_bend and config.method == "cascade" and not products.groups:
        with clock.stage("sequence"):
            first = find_disassembly(cascade, config=config.sequence, progress=counted)
        # a complete plan with fits spares the motions of one that leaves parts out
        with_fits = bend(first) if any(level.stuck for level in first.levels()) else None
    if with_fits is not None and not with_fits[0].unsolved:
        best, orderer = with_fits
    else:
        best = _best_attempt(planner, verifier, cascade, orderer, products, config, seed, progress, first=first)
        if best.unsolved and products.groups:
            side_by_side = replace(products, groups=())
            flat = _best_attempt(planner, verifier, cascade, orderer, side_by_side, config, seed, progress)
            if flat.worth > best.worth:
                reason = f"as one it could not be planned: {best.unsolved[0].part}: {best.unsolved[0].reason}"
                taken = replace(flat.taken, apart={group.name: reason for group in products.groups})
                best, products = replace(flat, taken=taken), side_by_side
        left_over = [entry.part for entry in best.unsolved]
        with_fits = bend(best.taken.found, left_over) if left_over and may_bend else None
        if with_fits is not None and with_fits[0].worth[0] > best.worth[0]:
            best, orderer = with_fits
    return _plan(assembly, bodies, orderer, verifier, best, config, seed, clock)


def _best_attempt(
    planner: TreePlanner,
    verifier: Verifier,
    cascade: Cascade,
    orderer: Orderer,
    products: Products,
    config: PipelineConfig,
    seed: int,
    progress: Progress,
    first: DisassemblyResult | None = None,
    fits: tuple[DeclaredFit, ...] = (),
) -> _Attempt:
    """Return the best of a few attempts, each of which does without what failed in those before.

    ``first`` is what level 1 finds with nothing refused, if that is known.
    """
    rng_contact = np.random.default_rng(seed).spawn(3)[2]
    refused: frozenset[Refusal] = frozenset()
    best: _Attempt | None = None
    known = first
    given_up = False
    refutations: dict[str, str] = {}
    for_contacts = config.contact_attempts if config.contacts else 0
    # what earlier attempts drew does not matter. Motions draw the same in each: the check knows those that come again
    for number, contact_rng in enumerate(rng_contact.spawn(config.max_attempts)):
        motion_rng = np.random.default_rng(seed).spawn(3)[1].spawn(1)[0]
        # where an order that was searched for fails twice, or for good, the one that was found first is tried
        searched = config.method == "cascade" and number < 2 and not given_up
        attempt = _attempt(
            planner,
            verifier,
            cascade,
            orderer,
            products,
            searched,
            refused,
            known,
            config,
            (motion_rng, contact_rng),
            progress,
            fits,
        )
        known = attempt.first
        refutations |= attempt.refutations
        if best is None or attempt.worth > best.worth:
            best = attempt
        again = attempt.refused - refused
        if not again and for_contacts > 0 and not attempt.unsolved:
            for_contacts -= 1
            again = attempt.contactless - refused
        if not again and searched and attempt.left_out:
            given_up = True
        elif not again:
            break
        refused |= again
        logger.info("going back to level 1 without %s", sorted(map(str, again)))
    assert best is not None, "at least one attempt is made"
    return replace(best, unsolved=tuple(_with_refutation(entry, refutations) for entry in best.unsolved))


@dataclass(frozen=True, kw_only=True)
class _Attempt:
    """One attempt: what the three levels made, and what the check said of it."""

    taken: TakenApart
    """What level 1 took apart."""
    first: DisassemblyResult | None
    """The same in the order that was found first; None where products were taken apart by themselves."""
    asked_without: frozenset[Refusal]
    """Departures that it was not to take."""
    steps: tuple[Step, ...]
    table: Table
    unsolved: tuple[Unsolved, ...]
    refused: frozenset[Refusal]
    """Departures that level 2 or the check refused."""
    contactless: frozenset[Refusal]
    """Departures for which no contact was found."""
    refutations: Mapping[str, str]
    """What the check, or level 2, said of each part whose motion it refused."""
    verified: bool
    fits: tuple[DeclaredFit, ...] = ()
    """The fits that its steps need."""

    @property
    def left_out(self) -> bool:
        """Whether a part is unsolved that level 1 took apart."""
        found = self.taken.found
        stuck = sum(len(level.stuck) for level in found.levels())
        return len(self.unsolved) > stuck

    @property
    def worth(self) -> tuple[int, int]:
        """How many parts are placed, and for how many of the steps there is a contact."""
        steps = [inner for step in self.steps for inner in step.all_steps]
        return len(placed_parts(self.steps)), sum(step.contact is not None for step in steps)


def _with_refutation(entry: Unsolved, refutations: Mapping[str, str]) -> Unsolved:
    """Return the entry; if all ways out of the part were refused, with what the last refusal said."""
    if entry.reason != REFUSED.reason or entry.part not in refutations:
        return entry
    return replace(entry, reason=f"{entry.reason}: {refutations[entry.part]}")


def _attempt(
    planner: TreePlanner,
    verifier: Verifier,
    cascade: Cascade,
    orderer: Orderer,
    products: Products,
    searched: bool,
    refused: frozenset[Refusal],
    before: DisassemblyResult | None,
    config: PipelineConfig,
    rngs: tuple[np.random.Generator, np.random.Generator],
    progress: Progress,
    fits: tuple[DeclaredFit, ...],
) -> _Attempt:
    assembly = planner.assembly
    count = len(assembly) - 1

    def counted(done: int) -> None:
        progress("sequence", done, count)

    up = config.motion.table.up if planner.resting is None else planner.resting.table.normal
    if products.groups:
        with planner.stage("order"):
            first = None
            options = {"config": config.sequence, "refused": refused, "up": up, "searched": searched}
            taken = take_apart_by_products(cascade, orderer, products, **options, progress=counted)
    else:
        if before is not None and config.method != "physics" and before.avoids(refused, cascade.parts.all_parts):
            first = before  # with nothing of it refused, the same would be found again
        else:
            with planner.stage("sequence"):
                first = _take_apart(planner, cascade, refused, config, rngs[1], counted)
        taken = TakenApart(found=first)
        if searched:
            with planner.stage("order"):
                taken = replace(taken, found=orderer.improve(taken.found, refused=refused, up=up))
    found = taken.found
    level = planner.plan(found, motion_rng=rngs[0], contact_rng=rngs[1], progress=progress)
    draft = _draft(assembly, level.table, level.steps, level.unsolved, fits)
    with planner.stage("verify"):
        report = verifier.check(draft)
    progress("verify", 1, 1)
    judge = _Judge(assembly, found, config)
    steps = judge.hold(level.steps, report.steps)
    known = {entry.part for entry in level.unsolved}
    unsolved = (*level.unsolved, *(entry for entry in judge.refuted if entry.part not in known))
    return _Attempt(
        first=first,
        taken=replace(taken, apart={**products.apart, **taken.apart}),
        asked_without=refused,
        steps=steps,
        table=level.table,
        unsolved=unsolved,
        refused=level.refused | judge.refused,
        contactless=judge.contactless(steps),
        refutations={entry.part: entry.reason for entry in (*level.failed, *judge.refuted)},
        verified=not (report.problems or unsolved),
        fits=_needed(fits, steps, report.steps),
    )


def _needed(
    fits: Sequence[DeclaredFit], steps: Sequence[Step], reports: Sequence[StepReport]
) -> tuple[DeclaredFit, ...]:
    """Return those of the fits without which some step that is kept would not hold."""
    kept = {inner.part for step in steps for inner in step.all_steps}
    every = [entry for report in reports for entry in report.all_steps() if entry.part in kept]
    used = {frozenset(names) for entry in every for names, _ in entry.fits}
    return tuple(fit for fit in fits if frozenset(fit.parts) in used)


def _take_apart(
    planner: TreePlanner,
    cascade: Cascade,
    refused: frozenset[Refusal],
    config: PipelineConfig,
    rng: np.random.Generator,
    progress: Callable[[int], None],
) -> DisassemblyResult:
    """Level 1: the cascade, or Algorithm 1, where a part that a later level refused is not pushed again."""
    if config.method != "physics":
        proposed = propose_removals(planner.assembly, config.network) if config.method == "past" else ()
        options = {"config": config.sequence, "refused": refused, "progress": progress}
        return find_disassembly(cascade, proposed=proposed, **options)
    parts = frozenset(part for refusal in refused for part in bits(refusal.members))
    options = {"config": config.algorithm1, "refused": parts, "progress": progress}
    if not (config.executable and config.contacts):
        return plan_disassembly(cascade.parts, **options)
    executable = Executability(
        planner.assembly, planner.bodies, gripper=named_gripper(config.gripper), config=config.contact, rng=rng
    )
    return plan_disassembly(cascade.parts, is_executable=executable, **options)


def propose_removals(assembly: Assembly, network: str) -> list[int]:
    """Return the parts in the order in which a network takes them out, the base last; SashimonoError without one."""
    from sashimono.learning.infer import assembly_clouds, encode_clouds, load_network, take_apart

    found = load_network(network)
    return take_apart(encode_clouds(assembly_clouds(assembly, found.relations), found), found)


class _Judge:
    """Takes the steps that the check refuted out of a plan."""

    def __init__(self, assembly: Assembly, found: DisassemblyResult, config: PipelineConfig) -> None:
        self._assembly = assembly
        self._config = config
        self._departures = {assembly.names[departure.part]: departure for departure in found.departures()}
        self.refuted: list[Unsolved] = []
        """Parts whose step was taken out."""
        self.refused: set[Refusal] = set()
        """Their departures."""

    def hold(self, steps: Sequence[Step], reports: Sequence[StepReport]) -> tuple[Step, ...]:
        """Return the steps that hold, here and inside subassemblies, each with what the check measured."""
        out: list[Step] = []
        gone: set[str] = set()
        turned: Table | None = None
        refuted = {s.part: self._met(s, entry) for s, entry in zip(steps, reports, strict=True) if entry.problems}
        for step, entry in zip(steps, reports, strict=True):
            # where the step is taken out before which the product is turned over, it is before the next one
            turned = step.table or turned
            fixed = tuple(name for name in step.fixed if name not in gone)
            if turned is not None and gone and self._floats(fixed, turned):
                gone.update(step.members)
                self._take_out(step, "what the product was to stand on, turned over, is not in place")
                continue
            if entry.problems or entry.contact_problems:
                logger.info("refuted: %s", entry.line())
            if entry.problems:
                gone.update(step.members)
                self._take_out(step, f"refuted by the check: {entry.problems[0]}", self._met(step, entry))
                continue
            if wrong := next((name for name in step.simultaneous if name in refuted), None):
                gone.update(step.members)
                reason = f"goes in at the same time as {wrong}, which was refuted by the check"
                self._take_out(step, reason, refuted[wrong])
                continue
            step = replace(step, fixed=fixed, table=turned, motion=self._with_evidence(step, entry))
            if entry.contact_problems:
                step = replace(
                    step, contact=None, carry=None, contact_reason=f"refuted by the check: {entry.contact_problems[0]}"
                )
            if step.subassembly is not None:
                inner = self.hold(step.subassembly.steps, entry.inside)
                order = tuple(each.part for each in inner)
                step = replace(step, subassembly=replace(step.subassembly, order=order, steps=inner))
            out.append(step)
            turned = None
        return tuple(out)

    def contactless(self, steps: Sequence[Step]) -> frozenset[Refusal]:
        """Return the departures of the steps that move and have no contact, inside subassemblies too.

        They are refused while all that was there is there: with less in place, fingers may get in.
        """
        every = [inner for step in steps for inner in step.all_steps]
        return frozenset(
            replace(self._departures[step.part].path_refusal, among=self._mask(step.fixed))
            for step in every
            if step.contact is None
            and len(step.motion.T_world_part) > 1
            and not step.simultaneous
            and step.part in self._departures
        )

    def _mask(self, names: Iterable[str]) -> int:
        return sum(1 << self._assembly.index(name) for name in names)

    def _floats(self, names: Sequence[str], table: Table) -> bool:
        """Whether nothing of these parts stands on a table."""
        parts = [self._assembly.part(name) for name in names]
        low = min(float((part.vertices_world @ table.normal).min()) for part in parts)
        least = min(smallest_extent(part.vertices_part, part.faces) for part in parts)
        return low - table.offset > self._config.verify.relative_tolerance * least

    def _met(self, step: Step, entry: StepReport) -> int:
        """Mask of the one placed part that a step goes too deep into; 0 if that is not all that is wrong with it."""
        too_deep = entry.allowed is not None and entry.max_penetration > entry.allowed
        if not too_deep or len(entry.problems) > 1:
            return 0
        return self._mask(name for name in step.fixed if name == entry.against)

    def _take_out(self, step: Step, reason: str, among: int | None = None) -> None:
        """Take a step out; its way is refused while these parts (a mask) are there, or not at all if None."""
        self.refuted += [
            Unsolved(part=name, answer=Answer.UNKNOWN, blocked_by=(), reason=reason) for name in step.members
        ]
        if step.part in self._departures and among is not None:
            self.refused.add(replace(self._departures[step.part].path_refusal, among=among))

    def _with_evidence(self, step: Step, entry: StepReport) -> Motion:
        part = self._assembly.part(step.part)
        tolerance = self._config.verify.relative_tolerance * smallest_extent(part.vertices_part, part.faces)
        evidence = {
            "max_penetration": entry.max_penetration,
            "tolerance": tolerance if entry.allowed is None else entry.allowed,
            "against": entry.against,
        }
        # inside its subassembly, a base has no departure: the one under its name is that of the whole
        if step.part in self._departures and len(step.motion.T_world_part) > 1:
            evidence["removal_found_by"] = self._departures[step.part].separation.stage
        return replace(step.motion, evidence={**step.motion.evidence, **evidence})


def _draft(
    assembly: Assembly,
    table: Table,
    steps: tuple[Step, ...],
    unsolved: tuple[Unsolved, ...],
    fits: tuple[DeclaredFit, ...],
) -> AssemblyPlan:
    return AssemblyPlan(
        status="partial" if unsolved else "complete",
        source=assembly.source or Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in assembly.parts},
        order=tuple(step.part for step in steps),
        steps=steps,
        unsolved=unsolved,
        table=table,
        fits=fits,
        overlaps=assembly.overlaps,
        identical=assembly.identical,
        notes=assembly.notes,
    )


def _plan(
    assembly: Assembly,
    bodies: Mapping[str, Body],
    orderer: Orderer,
    verifier: Verifier,
    attempt: _Attempt,
    config: PipelineConfig,
    seed: int,
    clock: _Clock,
) -> AssemblyPlan:
    steps = _with_fasteners(attempt.steps, orderer)
    draft = _draft(assembly, attempt.table, steps, attempt.unsolved, attempt.fits)
    status: Literal["complete", "partial"] = "complete" if attempt.verified else "partial"
    with clock.stage("stability"):
        held = replace(
            draft, status=status, hands=config.hands, products=_planned_products(assembly, steps, attempt.taken)
        )
        held = hold_plan(held, bodies, config=config.stability, touching=orderer.touching)
        executable = verifier.check_holds(held)
        cost = orderer.cost(held)
        held = replace(held, notes=(*held.notes, *orderer.parted(held)))
    if config.explain_order and config.method == "cascade":
        with clock.stage("order"):
            taken = attempt.taken
            held = orderer.explain(held, taken.found, attempt.asked_without, taken.groups)
    return replace(
        held,
        executable=executable,
        cost=cost,
        config=asdict(config),
        seed=seed,
        version=__version__,
        timings=clock.seconds,
    )


def _planned_products(assembly: Assembly, steps: Sequence[Step], taken: TakenApart) -> tuple[PlannedProduct, ...]:
    """How each product of the tree was planned: apart where nothing says otherwise."""
    benches = {step.subassembly.product for top in steps for step in top.all_steps if step.subassembly is not None}
    groups = {group.name: group for group in taken.groups}
    out = []
    for product in assembly.products:
        if (group := groups.get(product.name)) is not None:
            planned: Literal["subassembly", "base"] = "subassembly" if product.name in benches else "base"
            reason = f"without {few_words(group.later)}, put on later" if group.later else ""
            out.append(PlannedProduct(name=product.name, parts=product.parts, planned=planned, reason=reason))
        else:
            reason = taken.apart.get(product.name, "products are not looked at here")
            out.append(PlannedProduct(name=product.name, parts=product.parts, planned="apart", reason=reason))
    return tuple(out)


def _with_fasteners(steps: Sequence[Step], orderer: Orderer) -> tuple[Step, ...]:
    """The steps, those inside subassemblies too, with their close fits; of fasteners, what they are and what drives
    them."""
    out = []
    for k, step in enumerate(steps):
        with_it = [name for each in steps[:k] if each.part in step.simultaneous for name in each.members]
        step = replace(step, close_fits=orderer.close_fits_between(step.members, [*step.fixed, *with_it]))
        below = step.subassembly
        if below is not None:
            step = replace(step, subassembly=replace(below, steps=_with_fasteners(below.steps, orderer)))
        elif step.part in orderer.fastenings:
            tool = orderer.tool(step.part, step.fixed) if step.moves else None
            step = replace(step, fastener=orderer.fastenings[step.part], tool=tool)
        out.append(step)
    return tuple(out)


class _Clock:
    """Seconds spent by stage; reported, never decided on."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
