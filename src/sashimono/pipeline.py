"""The three levels composed: sequence, motion, contact, and the independent check at the end."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from typing import Literal

import numpy as np

from sashimono import __version__
from sashimono.assembly import Assembly, Source
from sashimono.bodies import make_bodies
from sashimono.contact import ContactChoice, ContactConfig, Executability, choose_contacts, named_gripper
from sashimono.disassembly.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.disassembly.separate import Cascade, SeparateConfig, Separation, names_of
from sashimono.disassembly.sequence import Ban, DisassemblyResult, SequenceConfig, find_disassembly
from sashimono.geometry.body import Body, SampleConfig
from sashimono.geometry.mesh import smallest_extent
from sashimono.motion import MotionConfig, MotionResult, plan_motions
from sashimono.plan import Answer, AssemblyPlan, Step, Unsolved
from sashimono.verify import VerifyConfig, VerifyReport, verify_plan

logger = logging.getLogger(__name__)

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""


@dataclass(frozen=True, kw_only=True)
class PipelineConfig:
    """Options of every level, and how often they go back to one another."""

    method: Literal["cascade", "physics"] = "cascade"
    """How removals are found: the cascade, or the paper's Algorithm 1."""
    algorithm1: Algorithm1Config = field(default_factory=Algorithm1Config)
    """Options of the method ``physics``."""
    executable: bool = True
    """Whether the method ``physics`` takes a part out only if a grasp for it exists (``isExec``)."""
    samples: SampleConfig = field(default_factory=SampleConfig)
    separate: SeparateConfig = field(default_factory=SeparateConfig)
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    contact: ContactConfig = field(default_factory=ContactConfig)
    verify: VerifyConfig = field(default_factory=VerifyConfig)
    gripper: str = "auto"
    """A preset's name, or ``auto``: generic jaws in proportion to each part."""
    contacts: bool = True
    """Whether level 3 runs."""
    max_attempts: int = 4
    """Sequences tried: each part whose motion fails, or is refuted, is refused that direction in the next."""


def plan_assembly(
    assembly: Assembly,
    *,
    config: PipelineConfig | None = None,
    seed: int = 0,
    progress: Progress = lambda stage, done, total: None,
) -> AssemblyPlan:
    """Plan an assembly: an order, a motion and a contact for each part, checked independently.

    The plan is ``complete`` only if every part has a motion and `verify_plan` found nothing wrong;
    otherwise it is ``partial`` and says of each missing part what is known. The same seed gives the
    same plan, timings apart. Raises SashimonoError for an unknown gripper.
    """
    config = config or PipelineConfig()
    named_gripper(config.gripper)
    clock = _Clock()
    rng_bodies, rng_motion, rng_contact = np.random.default_rng(seed).spawn(3)
    with clock.stage("sequence"):
        bodies = make_bodies(assembly, config=config.samples, rng=rng_bodies)
        cascade = Cascade(assembly, bodies, config=config.separate)
    banned: frozenset[Ban] = frozenset()
    best: _Attempt | None = None
    # spawned generators advance: each attempt gets its own, whatever the ones before drew
    for motion_rng, contact_rng in zip(
        rng_motion.spawn(config.max_attempts), rng_contact.spawn(config.max_attempts), strict=True
    ):
        attempt = _attempt(assembly, bodies, cascade, banned, config, (motion_rng, contact_rng), clock, progress)
        if best is None or len(attempt.steps) > len(best.steps):
            best = attempt
        if not attempt.refused - banned:
            break
        banned |= attempt.refused
        logger.info("going back to level 1 without %s", sorted(attempt.refused))
    assert best is not None, "at least one attempt is made"
    return _plan(assembly, best, config, seed, clock)


@dataclass(frozen=True, kw_only=True)
class _Attempt:
    """One way down the levels and what the check said of it."""

    motions: MotionResult
    steps: tuple[Step, ...]
    unsolved: tuple[Unsolved, ...]
    refused: frozenset[Ban]
    """Parts and directions that level 2 or the check refused."""
    verified: bool


def _attempt(
    assembly: Assembly,
    bodies: Mapping[str, Body],
    cascade: Cascade,
    banned: frozenset[Ban],
    config: PipelineConfig,
    rngs: tuple[np.random.Generator, np.random.Generator],
    clock: _Clock,
    progress: Progress,
) -> _Attempt:
    count = len(assembly) - 1
    with clock.stage("sequence"):
        done = lambda removed: progress("sequence", removed, count)  # noqa: E731
        if config.method == "physics":
            found = _by_physics(assembly, bodies, cascade, banned, config, rngs[1], done)
        else:
            found = find_disassembly(cascade, config=config.sequence, banned=banned, progress=done)
    witnesses = {assembly.names[part]: separation for part, separation in found.removals}
    order = [assembly.names[found.base], *reversed(witnesses)]
    stuck = [_unsolved(assembly, part, separation) for part, separation in found.stuck]
    with clock.stage("motion"):
        motions = plan_motions(
            assembly,
            order,
            {name: s.removal for name, s in witnesses.items() if s.removal is not None},
            config=config.motion,
            rng=rngs[0],
            in_place=[entry.part for entry in stuck],
            bodies=bodies,
            progress=lambda done, total: progress("motion", done, total),
        )
    failed = {entry.part: entry for entry in motions.unsolved}
    with clock.stage("contact"):
        moved = [name for name in order if name not in failed]
        contacts = _contacts(assembly, bodies, moved, motions, config, rngs[1], progress)
    steps = _steps(moved, motions, contacts)
    unsolved = [*stuck, *failed.values()]
    draft = _draft(assembly, motions, steps, tuple(unsolved))
    with clock.stage("verify"):
        report = verify_plan(draft, assembly, config=config.verify)
    progress("verify", 1, 1)
    return _judge(found, assembly, motions, steps, tuple(unsolved), report, frozenset(failed), config)


def _by_physics(
    assembly: Assembly,
    bodies: Mapping[str, Body],
    cascade: Cascade,
    banned: frozenset[Ban],
    config: PipelineConfig,
    rng: np.random.Generator,
    progress: Callable[[int], None],
) -> DisassemblyResult:
    """Algorithm 1; a part that a later level refused is not pushed again."""
    options = {"config": config.algorithm1, "refused": frozenset(part for part, _ in banned), "progress": progress}
    if not (config.executable and config.contacts):
        return plan_disassembly(cascade.blocking, **options)
    executable = Executability(assembly, bodies, gripper=named_gripper(config.gripper), config=config.contact, rng=rng)
    return plan_disassembly(cascade.blocking, is_executable=executable, **options)


def _contacts(
    assembly: Assembly,
    bodies: Mapping[str, Body],
    order: list[str],
    motions: MotionResult,
    config: PipelineConfig,
    rng: np.random.Generator,
    progress: Progress,
) -> Mapping[str, ContactChoice]:
    if not config.contacts:
        return {name: ContactChoice(None, "contacts were not asked for") for name in order}
    done = iter(range(1, len(order) + 1))
    return choose_contacts(
        assembly,
        order,
        motions.motions,
        motions.table,
        gripper=named_gripper(config.gripper),
        config=config.contact,
        rng=rng,
        bodies=bodies,
        progress=lambda name: progress("contact", next(done), len(order)),
    )


def _judge(
    found: DisassemblyResult,
    assembly: Assembly,
    motions: MotionResult,
    steps: tuple[Step, ...],
    unsolved: tuple[Unsolved, ...],
    report: VerifyReport,
    failed: frozenset[str],
    config: PipelineConfig,
) -> _Attempt:
    """Take out what the check refuted: a step that does not hold is no step."""
    bad = {entry.part: entry.problems for entry in report.steps if entry.problems}
    directions = {part: separation.signed for part, separation in found.removals}
    refused = frozenset(
        (assembly.index(name), -1 if (signed := directions[assembly.index(name)]) is None else signed)
        for name in {*failed, *bad}
        if assembly.index(name) in directions
    )
    refuted = tuple(
        Unsolved(part=name, answer=Answer.UNKNOWN, blocked_by=(), reason=f"refuted by the check: {problems[0]}")
        for name, problems in bad.items()
    )
    for entry in report.steps:
        if not entry.ok:
            logger.info("refuted: %s", entry.line())
    return _Attempt(
        motions=motions,
        steps=_without(_with_evidence(steps, found, assembly, report, config), frozenset(bad)),
        unsolved=(*unsolved, *refuted),
        refused=refused,
        verified=not (report.problems or unsolved or refuted),
    )


def _with_evidence(
    steps: tuple[Step, ...],
    found: DisassemblyResult,
    assembly: Assembly,
    report: VerifyReport,
    config: PipelineConfig,
) -> tuple[Step, ...]:
    """Write down what the check measured, and take out contacts that it refuted."""
    stages = {assembly.names[part]: separation.stage for part, separation in found.removals}
    out = []
    for step, entry in zip(steps, report.steps, strict=True):
        extent = smallest_extent(assembly.part(step.part).vertices_part, assembly.part(step.part).faces)
        evidence = {
            "max_penetration": entry.max_penetration,
            "tolerance": config.verify.relative_tolerance * extent if entry.allowed is None else entry.allowed,
            "against": entry.against,
        }
        if step.part in stages:
            evidence["removal_found_by"] = stages[step.part]
        motion = replace(step.motion, evidence={**step.motion.evidence, **evidence})
        step = replace(step, motion=motion)
        if entry.contact_problems:
            step = replace(step, contact=None, contact_reason=f"refuted by the check: {entry.contact_problems[0]}")
        out.append(step)
    return tuple(out)


def _without(steps: tuple[Step, ...], names: frozenset[str]) -> tuple[Step, ...]:
    return tuple(
        replace(step, fixed=tuple(name for name in step.fixed if name not in names))
        for step in steps
        if step.part not in names
    )


def _steps(order: list[str], motions: MotionResult, contacts: Mapping[str, ContactChoice]) -> tuple[Step, ...]:
    return tuple(
        Step(
            part=name,
            fixed=tuple(order[:k]),
            motion=motions.motions[name],
            contact=contacts[name].contact,
            contact_reason=contacts[name].reason,
        )
        for k, name in enumerate(order)
    )


def _unsolved(assembly: Assembly, part: int, separation: Separation) -> Unsolved:
    return Unsolved(
        part=assembly.names[part],
        answer=separation.answer,
        blocked_by=names_of(assembly, separation.blocked_by),
        reason=separation.reason,
    )


def _draft(
    assembly: Assembly, motions: MotionResult, steps: tuple[Step, ...], unsolved: tuple[Unsolved, ...]
) -> AssemblyPlan:
    return AssemblyPlan(
        status="partial" if unsolved else "complete",
        source=assembly.source or Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in assembly.parts},
        order=tuple(step.part for step in steps),
        steps=steps,
        unsolved=unsolved,
        table=motions.table,
        overlaps=assembly.overlaps,
        identical=assembly.identical,
        notes=assembly.notes,
    )


def _plan(assembly: Assembly, attempt: _Attempt, config: PipelineConfig, seed: int, clock: _Clock) -> AssemblyPlan:
    draft = _draft(assembly, attempt.motions, attempt.steps, attempt.unsolved)
    return replace(
        draft,
        status="complete" if attempt.verified else "partial",
        config=asdict(config),
        seed=seed,
        version=__version__,
        timings=clock.seconds,
    )


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
