"""A small plan made by hand, for the tests of the viewer files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part, Source
from sashimono.geometry import se3
from sashimono.plan import (
    Answer,
    AssemblyPlan,
    Contact,
    Motion,
    MotionClass,
    Segment,
    Step,
    Subassembly,
    Table,
    Unsolved,
)

NAMES = ("block_0", "block_1", "block_2", "block_3")
HOSTILE_NAMES = (
    "</script><script>window.broken=1</script>",
    "<!--<img src=x onerror='window.broken=1'>",
    "quote\" 'apostrophe' \\back ${1} %%DATA%% &amp;",
    "歯車 ∅40 \u2028 \U0001f529",
)
_CUBE_FACES = np.array(
    [[0, 3, 2], [0, 1, 3], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5],
     [2, 7, 6], [2, 3, 7], [0, 6, 4], [0, 2, 6], [1, 7, 3], [1, 5, 7]]
)  # fmt: skip


def box(size: tuple[float, float, float]) -> tuple[Float[np.ndarray, "8 3"], np.ndarray]:
    """Return vertices [m] and faces of a box about the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return corners * np.array(size), _CUBE_FACES


def _step(k: int, names: tuple[str, ...], assembled: np.ndarray) -> Step:
    if k == 0:
        return Step(part=names[0], fixed=(), motion=Motion(T_world_part=assembled[None], segments=()), contact=None)
    resting = se3.make(se3.exp_so3(np.array([0.0, 0.0, 1.2])), np.array([-0.1 - 0.06 * k, -0.05, 0.01]))
    above = assembled @ se3.make(translation=np.array([0.0, 0.0, 0.05]))
    motion = Motion(
        T_world_part=np.array([resting, resting @ se3.make(translation=np.array([0.0, 0.0, 0.08])), above, assembled]),
        segments=(Segment(kind="transit", start=0, stop=2), Segment(kind="insertion", start=2, stop=3)),
        evidence={"max_penetration": 1e-5 * k, "tolerance": 1e-4},
    )
    contact = Contact(
        kind="grasp",
        points_part=np.array([[-0.02, 0.0, 0.0], [0.02, 0.0, 0.0]]),
        normals_part=np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
        friction=0.2,
        quality=0.1,
        T_part_gripper=se3.make(np.diag([1.0, -1.0, -1.0])) if k == 1 else None,
    )
    reason = "no antipodal pair is free" if k == 2 else None
    return Step(
        part=names[k], fixed=names[:k], motion=motion, contact=None if k == 2 else contact, contact_reason=reason
    )


def stacked_blocks(names: tuple[str, ...] = NAMES, *, unsolved: int = 0) -> tuple[AssemblyPlan, Assembly]:
    """Return a plan that stacks four blocks, the last ``unsolved`` of them without a step."""
    vertices, faces = box((0.04, 0.03, 0.02))
    parts = tuple(
        Part(
            name=name,
            vertices_part=vertices,
            faces=faces,
            T_world_part=se3.make(se3.exp_so3(np.array([0.0, 0.0, 0.3 * k])), np.array([0.0, 0.0, 0.01 + 0.02 * k])),
        )
        for k, name in enumerate(names)
    )
    assembly = Assembly(parts=parts, identical=(names,))
    solved = len(parts) - unsolved
    plan = AssemblyPlan(
        status="partial" if unsolved else "complete",
        source=Source(path="somewhere/blocks", sha256="0", unit="m"),
        parts={part.name: part.T_world_part for part in parts},
        order=names[:solved],
        steps=tuple(_step(k, names, parts[k].T_world_part) for k in range(solved)),
        unsolved=tuple(
            Unsolved(
                part=name,
                answer=Answer.PROVEN_BLOCKED,
                blocked_by=(names[0],),
                reason="held by a hook",
                proven_for=MotionClass.TRANSLATIONS,
            )
            for name in names[solved:]
        ),
        table=Table(normal=np.array([0.0, 0.0, 1.0]), offset=0.0),
        version="0",
    )
    return plan, assembly


def paired_blocks() -> tuple[AssemblyPlan, Assembly]:
    """Return a plan whose last step brings the upper two blocks as one, stacked before."""
    plan, assembly = stacked_blocks()
    lower, upper = plan.steps[2], plan.steps[3]
    base = Step(
        part=lower.part, fixed=(), motion=Motion(T_world_part=plan.parts[lower.part][None], segments=()), contact=None
    )
    inside = Subassembly(
        order=(lower.part, upper.part), steps=(base, replace(upper, fixed=(lower.part,))), table=plan.table
    )
    pair = replace(lower, moving=(lower.part, upper.part), subassembly=inside)
    return replace(plan, order=plan.order[:3], steps=(*plan.steps[:2], pair)), assembly
