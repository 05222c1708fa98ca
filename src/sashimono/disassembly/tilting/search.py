"""The search of a part that must tilt: a tree of poses along the contact surface, until a straight way out opens.

From the assembled pose a tree grows by slides (`sliding`): a node is drawn, a motion is wanted of it, and it follows
this motion as far as the contacts let it (expansive space trees: Hsu, Latombe and Motwani, "Path planning in expansive
configuration spaces", 1997; retraction to the contact surface as in Zhang and Manocha, "An efficient retraction-based
RRT planner", 2008). At each new node straight exits are tried. The way to an exit is then checked exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.tilting.axes import round_axes
from sashimono.disassembly.tilting.contact_surface import ContactSurface, Gaps
from sashimono.disassembly.tilting.exits import straight_exit
from sashimono.disassembly.tilting.sliding import SlideConfig, Wanted, gaps_at, slide
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import between
from sashimono.geometry.features.directions import sphere_directions
from sashimono.geometry.overlap import intersection_depth


@dataclass(frozen=True, kw_only=True)
class TiltConfig:
    """Growth and budget of the tree; it counts work, never time."""

    slide: SlideConfig = field(default_factory=SlideConfig)
    growth: Literal["est", "rrt"] = "est"
    """How the tree grows: from sparse places along motions at random, or towards poses at random."""
    leeway: float = 0.3
    """Share of the depth tolerated beyond the assembled overlap (`Tolerances.turning`) that sliding may use. The rest
    is for what the check sees between poses."""
    most_probes: int = 450
    """Points of a part at which contact is felt."""
    max_slides: int = 900
    """Slides tried for one part."""
    max_traced: int = 6_000_000
    """Tracing steps (`Paths.traced`) for one part; looked at after each slide."""
    attempts: int = 3
    """Trees grown in turn, each with an equal share of the steps: one that began badly seldom recovers."""
    trial_slides: int = 60
    """After so many slides, a part that got nowhere is given up."""
    least_reach: float = 0.06
    """Nowhere is nearer to the assembled pose than this, over the part's radius."""
    novelty: float = 0.06
    """A pose nearer than this, over the part's radius, to a known one is not new."""
    last_novelty: float = 0.25
    """The same for the last pose of a slide, over that."""
    aligning: float = 0.25
    """Share of the motions drawn that bring a line of the part in line with one of the assembly."""
    spread: int = 8
    """Lines spread evenly over all directions, along which an exit is tried besides the parts' own."""
    about_axes: float = 0.3
    """Share of the others that turn about the axis of a round face."""
    most_axes: int = 3
    """Axes taken of one part."""
    boolean_spacing: float = 0.04
    """Way between two poses at which a found path is looked at by booleans, over the part's radius."""
    booleans: int = 12
    """Most such poses on one stretch."""
    shortcuts: int = 30
    """Attempts to shorten a path that was found."""
    seed: int = 0
    """Of the draws; each question draws anew from it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TiltResult:
    """A removal along the contact surface, or why there is none."""

    removal: Removal | None
    reason: str = ""
    slides: int = 0
    """Slides tried."""
    nodes: int = 0
    """Poses reached."""
    traced: int = 0
    """Tracing steps taken."""


class _Tree:
    """Poses reached, with how they were reached."""

    def __init__(self, paths: Paths, spacing: float) -> None:
        self.center, self.radius, self.spacing = paths.center, paths.body.radius, spacing
        self.poses = [np.eye(4)]
        self.parents = [-1]
        self.visits = [0]
        self._all = np.eye(4)[None]
        self._axis = _symmetry_axis(paths)
        self.crowd = np.ones(1)
        """How many nodes are near each."""

    def gaps_to(self, D: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "node"]:
        """Return the distance to each node [m]: that of the part's centre plus the angle times its radius.

        Of a body of revolution, the angle is that of its axis.
        """
        shift = (self._all[:, :3, :3] - D[:3, :3]) @ self.center + (self._all[:, :3, 3] - D[:3, 3])
        turned = self._all[:, :3, :3] - D[:3, :3]
        if self._axis is None:
            chord = np.linalg.norm(turned.reshape(-1, 9), axis=1) / np.sqrt(8.0)
        else:
            chord = 0.5 * np.linalg.norm(turned @ self._axis, axis=1)
        return np.linalg.norm(shift, axis=1) + self.radius * 2.0 * np.arcsin(np.minimum(chord, 1.0))

    def add(self, D: Float[np.ndarray, "4 4"], parent: int, gaps: Float[np.ndarray, "node"]) -> int:
        near = gaps < 4.0 * self.spacing
        self.crowd = np.append(self.crowd + near, 1.0 + near.sum())
        self.poses.append(D)
        self.parents.append(parent)
        self.visits.append(0)
        self._all = np.concatenate([self._all, D[None]])
        return len(self.poses) - 1

    def branch(self, node: int) -> list[int]:
        """Return the nodes from the assembled pose to this one."""
        out = []
        while node >= 0:
            out.append(node)
            node = self.parents[node]
        return out[::-1]

    def cut(self, node: int) -> None:
        """Take a node, and what grew from it, out of the draws: the exact check refused the way there."""
        for k in range(node, len(self.poses)):
            if node in self.branch(k):
                self.crowd[k] = np.inf


def _symmetry_axis(paths: Paths) -> Float[np.ndarray, "3"] | None:
    """The axis of a part that looks like a body of revolution, assembled, in the world frame; None of any other."""
    mass = paths.body.mass_properties
    moments = mass.moments
    for k in range(3):
        first, second = np.delete(moments, k)
        apart = abs(moments[k] - 0.5 * (first + second))
        if abs(first - second) < 1e-3 * apart:
            return paths.T_assembled[:3, :3] @ mass.axes[:, k]
    return None


def search_tilt(parts: PlacedParts, part: int, others: Sequence[int], *, config: TiltConfig) -> TiltResult:
    """Return a removal of the part past the others by tilts, turns and shifts; no removal is never a proof."""
    paths = Paths(parts, part, others, tolerance=parts.tolerances.turning)
    surface = ContactSurface(paths, most_probes=config.most_probes, leeway=config.leeway)
    removal, is_held, slides, nodes = None, False, 0, 0
    for attempt in range(config.attempts):
        search = _Search(surface, config, np.random.default_rng([config.seed, attempt]))
        share = config.max_traced * (attempt + 1) // config.attempts
        removal, tried = search.run(max_slides=config.max_slides - slides, max_traced=share)
        slides, nodes, is_held = slides + tried, nodes + len(search.tree.poses), search.is_held
        if removal is not None or is_held or slides >= config.max_slides:
            break
    if removal is not None:
        reason = ""
    elif is_held:
        reason = "no tilt or shift leads away from the assembled pose"
    elif slides >= config.max_slides:
        reason = f"tilting ran out of its budget of {config.max_slides} slides"
    else:
        reason = f"tilting ran out of its budget of {config.max_traced} tracing steps"
    return TiltResult(removal=removal, reason=reason, slides=slides, nodes=nodes, traced=paths.traced)


class _Search:
    """One question's tree."""

    def __init__(self, surface: ContactSurface, config: TiltConfig, rng: np.random.Generator) -> None:
        self.surface, self.paths, self.config, self.rng = surface, surface.paths, config, rng
        self.is_held = False
        """Whether the part got nowhere."""
        self.radius = self.paths.body.radius
        self.tree = _Tree(self.paths, config.novelty * self.radius)
        self._gaps: dict[int, tuple[Gaps, int]] = {}
        """By node: what is near the part, and the tracing steps that it took to see."""
        self.frame = self.paths.parts.frame(self.paths.part)
        parts = self.paths.parts
        self.lines = parts.lines
        self.own_lines = parts.part_lines[self.paths.part]
        self.spread = sphere_directions(2 * self.config.spread)[: self.config.spread] @ self.frame
        self.axes = self._round_axes()

    def run(self, *, max_slides: int, max_traced: int) -> tuple[Removal | None, int]:
        """Return the removal, if one is found within the budgets, and the slides tried."""
        config = self.config
        draw = self._draw_motion if config.growth == "est" else self._draw_target
        reach = 0.0
        for slides in range(max_slides):
            self.is_held = slides >= config.trial_slides and reach < config.least_reach * self.radius
            if self.is_held or self.paths.traced >= max_traced:
                return None, slides
            node, wanted = draw()
            self.tree.visits[node] += 1
            near = self._near(node)
            passed = slide(self.surface, self.tree.poses[node], near, wanted, config=config.slide)
            for k, D in enumerate(passed):
                gaps = self.tree.gaps_to(D)
                # where a slide ends things meet, or are in line: that is worth a node of its own
                if gaps.min() < self.tree.spacing * (1.0 if k < len(passed) - 1 else config.last_novelty):
                    continue
                reach = max(reach, float(gaps[0]))
                node = self.tree.add(D, node, gaps)
                if (removal := self._exit(node)) is not None:
                    return removal, slides + 1
                if np.isinf(self.tree.crowd[node]):
                    break
        return None, max_slides

    def _near(self, node: int) -> Gaps:
        """What is near the part at a node; it costs the same each time that it is asked."""
        if node not in self._gaps:
            before = self.paths.traced
            found = gaps_at(self.surface, self.tree.poses[node], config=self.config.slide)
            self._gaps[node] = found, self.paths.traced - before
        else:
            self.paths.traced += self._gaps[node][1]
        return self._gaps[node][0]

    def _exit(self, node: int) -> Removal | None:
        D = self.tree.poses[node]
        near = self.surface.gaps(D, margin=0.02 * self.paths.size)
        lines = np.concatenate([self.own_lines @ D[:3, :3].T, self.lines, self.spread])
        found = straight_exit(self.surface, D, near, lines)
        if found is None:
            return None
        branch = self.tree.branch(node)
        for k, after in pairwise(branch):
            if not self._holds(self.tree.poses[k], self.tree.poses[after]):
                self.tree.cut(after)
                return None
        displacements = np.array([*self._shortened([self.tree.poses[k] for k in branch]), found[0]])
        if not (self._shares_little(displacements[-2], found[0]) and self.paths.parts_once(displacements)):
            return None
        return Removal(displacements=displacements, exit_direction=found[1])

    def _holds(self, a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"]) -> bool:
        """Return whether the part can follow the geodesic: by the exact check's probes, and by booleans."""
        return self.paths.check(np.array([a, b])) and self._shares_little(a, b)

    def _shares_little(self, a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"]) -> bool:
        """Return whether the bodies shared with the others at some poses of the geodesic are as thin as tolerated.

        Where two edges cross, no probe tells how deep.
        """
        paths, parts, config = self.paths, self.paths.parts, self.config
        twist = between(a, b)
        count = int(np.clip(np.ceil(paths.distance(a, b) / (config.boolean_spacing * self.radius)), 1, config.booleans))
        for u in np.arange(1, count + 1) / count:
            D = se3.exp(u * twist) @ a
            for other in paths.near(D):
                limit = parts.limit(paths.part, other, parts.tolerances.translation)
                T = se3.inverse(parts.poses[other]) @ D @ paths.T_assembled
                depth = intersection_depth(paths.body, parts.bodies[other], T)
                if depth is not None and depth > limit:
                    return False
        return True

    def _draw_motion(self) -> tuple[int, Wanted]:
        """A node where few are, the less the oftener it was drawn, and a motion at random."""
        tree, rng = self.tree, self.rng
        weights = 1.0 / (tree.crowd * (1.0 + np.array(tree.visits)) ** 2)
        node = int(rng.choice(len(weights), p=weights / weights.sum()))
        D = tree.poses[node]
        if rng.random() < self.config.aligning:
            return node, self._towards(self._aligned(D))
        if len(self.axes) and rng.random() < self.config.about_axes:
            return node, self._towards(self._turned(D))
        kind = rng.random()
        line = self._line(D)
        motion = np.zeros(6)
        if kind < 0.3:
            motion[:3] = line
        elif kind < 0.7:
            motion[3:] = line
            # about an axis through a place on the part, not its centre
            arm = self.radius * (self.frame.T @ rng.uniform(-1.0, 1.0, 3))
            if rng.random() < 0.6:
                motion[:3] = -se3.cross(line, arm) / self.radius
        else:
            motion = rng.standard_normal(6)
            motion[:3] = self.frame.T @ motion[:3]
            motion[3:] = self.frame.T @ motion[3:]
        motion *= self.radius * rng.uniform(0.2, 1.6) / np.linalg.norm(motion)
        return node, self._towards(self.surface.moved(D, motion))

    def _towards(self, target: Float[np.ndarray, "4 4"]) -> Wanted:
        return lambda now: self.surface.motion_to(now, target)

    def _aligned(self, D: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """The displacement turned about the part's centre, as little as needed to bring two lines in line."""
        own = D[:3, :3] @ self.own_lines[self.rng.integers(len(self.own_lines))]
        cosines = self.lines @ own
        apart = np.arccos(np.minimum(np.abs(cosines), 1.0))
        # the nearer, the likelier; what is in line already brings nothing
        weights = np.where(apart > np.radians(0.2), 1.0 / (0.1 + apart), 0.0)
        if not weights.any():
            return D
        k = int(self.rng.choice(len(weights), p=weights / weights.sum()))
        axis = se3.cross(own, np.sign(cosines[k]) * self.lines[k])
        length = float(np.linalg.norm(axis))
        if length < 1e-9:
            return D
        motion = np.concatenate([np.zeros(3), self.radius * apart[k] * axis / length])
        return self.surface.moved(D, motion)

    def _turned(self, D: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """The displacement turned about an axis of the part where it is, or of one of the others."""
        k = int(self.rng.integers(len(self.axes)))
        T = self.axis_frames[k]
        T = D @ self.paths.T_assembled if T is None else T
        point, line = se3.apply(T, self.axes[k][:1])[0], T[:3, :3] @ self.axes[k][1]
        w = self.rng.uniform(-0.9, 0.9) * np.pi * line
        return se3.exp(np.concatenate([-se3.hat(w) @ point, w])) @ D

    def _line(self, D: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "3"]:
        """A signed direction: a line of the part where it is, one of the assembly, or any."""
        rng = self.rng
        kind = rng.random()
        if kind < 0.45:
            line = D[:3, :3] @ self.own_lines[rng.integers(len(self.own_lines))]
        elif kind < 0.8:
            line = self.lines[rng.integers(len(self.lines))]
        else:
            line = rng.standard_normal(3)
            line = self.frame.T @ (line / np.linalg.norm(line))
        return line if rng.random() < 0.5 else -line

    def _draw_target(self) -> tuple[int, Wanted]:
        """A pose at random in the room about the assembled one, and the node nearest to it."""
        rng = self.rng
        shift = self.radius * (self.frame.T @ rng.uniform(-2.0, 2.0, 3))
        angle = rng.uniform(-np.pi, np.pi) if rng.random() < 0.3 else 0.6 * rng.standard_normal()
        R = se3.exp_so3(angle * self._line(np.eye(4)))
        center = self.paths.center
        target = se3.make(R, center + shift - R @ center)
        node = int(np.argmin(self.tree.gaps_to(target) + np.where(np.isinf(self.tree.crowd), np.inf, 0.0)))
        return node, self._towards(target)

    def _round_axes(self) -> list[Float[np.ndarray, "2 3"]]:
        """Axes of round faces near the part, in its own frame, or in that of an other one (``axis_frames``)."""
        parts, most = self.paths.parts, self.config.most_axes
        merge = 0.03 * self.radius
        own = list(round_axes(self.paths.body, most=most, merge=merge))
        self.axis_frames: list[np.ndarray | None] = [None] * len(own)
        for other in self.paths.near(np.eye(4)):
            for axis in round_axes(parts.bodies[other], most=most, merge=merge):
                middle = se3.apply(parts.poses[other], axis[:1])[0] - self.paths.center
                line = parts.poses[other][:3, :3] @ axis[1]
                if np.linalg.norm(middle - (middle @ line) * line) < 1.5 * self.radius:
                    own.append(axis)
                    self.axis_frames.append(parts.poses[other])
        return own

    def _shortened(self, poses: list[Float[np.ndarray, "4 4"]]) -> list[Float[np.ndarray, "4 4"]]:
        """Leave out poses that are not needed, then try shortcuts between random ones."""

        def length(a: np.ndarray, b: np.ndarray) -> float:
            return self.paths.distance(a, b)

        for _ in range(self.config.shortcuts if len(poses) > 2 else 0):
            i, j = np.sort(self.rng.choice(len(poses), 2, replace=False))
            if j - i < 2:
                continue
            through = sum(length(a, b) for a, b in pairwise(poses[i : j + 1]))
            turn = np.linalg.norm(se3.log_so3(poses[i][:3, :3].T @ poses[j][:3, :3]))
            if turn < 0.8 * np.pi and length(poses[i], poses[j]) <= through and self._holds(poses[i], poses[j]):
                poses = [*poses[: i + 1], *poses[j:]]
            if len(poses) == 2:
                break
        return poses
