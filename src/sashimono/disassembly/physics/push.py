"""Algorithm 1's ``simulate``: one part is pushed among parts that stand still, until it is out or at rest.

Event-driven instead of stepped in time: contact with friction says along which screw the part slides now, the
exact check says how far it may follow it, and there the question is asked again. Clearance, tessellation and
drift are taken up by fitting the part back between its contacts after each stretch.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.alignments import alignments
from sashimono.disassembly.physics.contact_solver import Contacts, sliding_twist
from sashimono.disassembly.physics.screw_estimate import ScrewEstimate
from sashimono.disassembly.physics.slippage import SlippageConfig, find_contacts, snapped, spatial_twist
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import between


@dataclass(frozen=True, kw_only=True)
class SimulateConfig:
    """Contact model and budget of one simulated push; lengths over the smaller part's smallest extent."""

    friction: float = 0.2
    """Coulomb friction coefficient."""
    gap: float = 0.02
    """Surfaces nearer than this touch."""
    slippage: SlippageConfig = field(default_factory=SlippageConfig)
    """How axes are read off contacts and geometry."""
    slack: float = 0.005
    """How much a contact may close unhindered, so that zero clearance and facets do not wedge."""
    wide_snap: float = np.radians(20.0)
    """Angle to a line of the geometry [rad] below which that is tried as the axis too."""
    iterations: int = 100
    """Rounds of the contact solver."""
    solver_tolerance: float = 1e-4
    """Change of impulse, over the push, at which the contact solver stops."""
    rest: float = 0.05
    """A part that answers a push with less than this share of its motion rests."""
    least_advance: float = 0.02
    """A stretch shorter than this over the moving part's smallest extent ends the push."""
    turn: float = np.pi / 3.0
    """Largest turn of one stretch [rad]; geodesics need less than π."""
    first_turn: float = np.pi / 12.0
    """Largest turn of a stretch that no stretch before it confirms [rad]."""
    max_stretches: int = 20
    """Stretches of one push, but for those that follow a known screw unhindered."""
    max_confirmed: int = 120
    """Stretches of one push that follow a known screw unhindered."""
    halts: int = 4
    """Poses within one turning stretch, with faces parallel to an obstacle's, at which an exit is tried."""
    centering: int = 2
    """Gauss-Newton steps that fit the part between its contacts after a stretch."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulated:
    """Where a push led."""

    displacements: Float[np.ndarray, "waypoint 4 4"]
    """Checked waypoints from where the push began; the last one is at rest, or out."""
    exit_direction: Float[np.ndarray, "3"] | None
    """Direction of the last leg if the part is out, else None."""
    met: tuple[int, ...]
    """Parts that stopped it."""
    stretches: int
    """Stretches followed, but for those along a known screw."""

    def removal(self, before: Float[np.ndarray, "waypoint 4 4"]) -> Removal:
        """Return the removal that this push completes, after the waypoints that led to where it began."""
        assert self.exit_direction is not None, "only a part that is out has a removal"
        return Removal(
            displacements=np.concatenate([before[:-1], self.displacements]), exit_direction=self.exit_direction
        )


def simulate(
    paths: Paths, D: Float[np.ndarray, "4 4"], push: Float[np.ndarray, "6"], *, config: SimulateConfig
) -> Simulated:
    """Return where the part goes from D under a push: a wrench (force, torque) about its centre, world frame.

    Lengths are over the part's radius, so that a unit force and a unit torque move its far points alike. Every
    stretch in the answer has been checked.
    """
    poses, met, helix = [D], set(), ScrewEstimate(config.turn)
    stretches = short = confirmed = 0
    while stretches < config.max_stretches and confirmed < config.max_confirmed and short < 2:
        twists = _responses(paths, poses[-1], push, helix, config)
        if not twists:
            break
        twist, u, stopper = _farthest(paths, poses[-1], twists)
        if stopper is None and twist is helix.twist:
            confirmed += 1
        else:
            stretches += 1
        if stopper is None and not twist[3:].any():
            direction = _unit(twist[:3])
            return _finished([*poses, paths.out(poses[-1], direction)], direction, met, stretches)
        if stopper is not None:
            met.add(stopper)
        short = short + 1 if u * paths.rate(poses[-1], twist) < config.least_advance * paths.size else 0
        if u == 0.0:
            continue
        if (turned := _exit_on_the_way(paths, poses[-1], u * twist, config)) is not None:
            return _finished([*poses, *turned[0]], turned[1], met, stretches)
        reached, contacts = _centered(paths, poses[-1], se3.exp(u * twist) @ poses[-1], config)
        poses.append(reached)
        helix.follow(between(poses[-2], reached), contacts)
        for direction in _along(twist):
            end = paths.exit(reached, direction)
            if end is not None:
                smooth = helix.smoothed(paths, poses, direction) or ([*poses, end], direction)
                return _finished(*smooth, met, stretches)
        if any(paths.distance(reached, pose) < config.least_advance * paths.size for pose in poses[:-1]):
            break  # once around
    return _finished(poses, None, met, stretches)


def _exit_on_the_way(
    paths: Paths, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"], config: SimulateConfig
) -> tuple[list[Float[np.ndarray, "4 4"]], Float[np.ndarray, "3"]] | None:
    """Where on a turn the part leaves along the axis, past the others then, and the direction; None if nowhere."""
    directions = _along(twist)
    if not directions:
        return None
    for u in alignments(paths, D, twist, most=config.halts):
        pose = se3.exp(u * twist) @ D
        for direction in directions:
            end = paths.exit(pose, direction)
            if end is not None:
                return [pose, end], direction
    return None


def _finished(
    poses: list[np.ndarray], exit_direction: Float[np.ndarray, "3"] | None, met: set[int], stretches: int
) -> Simulated:
    return Simulated(
        displacements=np.array(poses), exit_direction=exit_direction, met=tuple(sorted(met)), stretches=stretches
    )


def _responses(
    paths: Paths,
    D: Float[np.ndarray, "4 4"],
    push: Float[np.ndarray, "6"],
    helix: ScrewEstimate,
    config: SimulateConfig,
) -> list[Float[np.ndarray, "6"]]:
    """The screws that the part may follow now, likeliest first: whole stretches, spatial, world frame; none at rest.

    Contact at sampled points tells a screw to some degrees only; how far the part gets along it tells the rest.
    """
    contacts = find_contacts(paths, D, gap=config.gap, facing=config.slippage.facing)
    slack = config.slack * paths.size / paths.body.radius
    contacts = Contacts(contacts.normals, contacts.arms, np.maximum(contacts.gaps, 0.0) + slack)
    options = {"iterations": config.iterations, "tolerance": config.solver_tolerance}
    answer = sliding_twist(contacts, push, friction=config.friction, **options)
    if np.linalg.norm(answer) < config.rest:
        return []
    lines = paths.parts.lines
    likely = []
    for snap in (config.slippage.snap, config.wide_snap):
        along = snapped(contacts.rows, answer, lines, config=replace(config.slippage, snap=snap))
        if not any(np.allclose(along, other) for other in likely):
            likely.append(along)
    twists = [_stretch(paths, D, twist, config) for twist in likely]
    known = helix.twist
    # along a thread, the stretches so far tell axis and pitch better than the contacts of one pose
    if known is not None:
        whole = twists[0] * (config.turn / max(float(np.linalg.norm(twists[0][3:])), 1e-9))
        if paths.rate(D, known - whole) < 0.5 * paths.rate(D, whole):
            twists.insert(0, known)
    return twists


def _stretch(
    paths: Paths, D: Float[np.ndarray, "4 4"], answer: Float[np.ndarray, "6"], config: SimulateConfig
) -> Float[np.ndarray, "6"]:
    """As far along a twist about the centre as is followed at once: out by a translation, a part of a turn else."""
    twist = spatial_twist(answer, se3.apply(D, paths.center[None])[0], paths.body.radius)
    turn = float(np.linalg.norm(twist[3:]))
    if turn < 0.02 * float(np.linalg.norm(answer[:3])):
        return paths.straight(D, _unit(answer[:3]))
    return twist * (config.first_turn / turn)


def _farthest(
    paths: Paths, D: Float[np.ndarray, "4 4"], twists: list[Float[np.ndarray, "6"]]
) -> tuple[Float[np.ndarray, "6"], float, int | None]:
    """The first twist that nothing stops, else the one along which the part comes farthest; u, and what stops it."""
    best = (twists[0], 0.0, None)
    far = -1.0
    for twist in twists:
        u, stopper = paths.advance_to_contact(D, twist)
        if stopper is None:
            return twist, u, None
        way = u * paths.rate(D, twist)
        if way > far:
            best, far = (twist, u, stopper), way
    return best


def _unit(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    return vector / np.linalg.norm(vector)


def _along(twist: Float[np.ndarray, "6"]) -> list[Float[np.ndarray, "3"]]:
    """Both ways along the axis of a screw, the one in which it shifts the part first; nothing for a translation."""
    turn = float(np.linalg.norm(twist[3:]))
    if turn == 0.0:
        return []
    axis = twist[3:] / turn
    return [axis, -axis] if float(axis @ twist[:3]) >= 0.0 else [-axis, axis]


def _centered(
    paths: Paths, D_before: Float[np.ndarray, "4 4"], D: Float[np.ndarray, "4 4"], config: SimulateConfig
) -> tuple[Float[np.ndarray, "4 4"], int]:
    """The pose that evens out overlaps and small gaps, if that lessens overlaps and the way there passes, and how many
    contacts there are; else the pose itself, and 0."""
    fitted, count, before = D, 0, 0.0
    radius = paths.body.radius
    for k in range(config.centering + 1):
        contacts = find_contacts(paths, fitted, gap=config.gap, facing=config.slippage.facing)
        overlap = -float(contacts.gaps.min(initial=0.0))
        before = overlap if k == 0 else before
        close = contacts.gaps < config.slack * paths.size / radius
        count = int(close.sum())
        if count < 6 or k == config.centering:
            break
        rows, gaps = contacts.rows[close], contacts.gaps[close]
        damped = rows.T @ rows / count + 1e-3 * np.eye(6)
        step = -np.linalg.solve(damped, rows.T @ gaps / count)
        fitted = se3.exp(spatial_twist(step, se3.apply(fitted, paths.center[None])[0], radius)) @ fitted
    worse = overlap > before or paths.distance(D, fitted) > 2.0 * config.gap * paths.size
    if worse or paths.advance(D_before, between(D_before, fitted))[1] is not None:
        return D, 0
    return fitted, count
