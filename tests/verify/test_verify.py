"""The independent check: sound plans pass, and every way of cheating is refuted."""

from __future__ import annotations

import dataclasses
from typing import Any

import igl
import numpy as np
import pytest
import trimesh

from sashimono.assembly import Assembly, Part, Source
from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.io.plan_json import write_plan
from sashimono.io.read import read_assembly
from sashimono.plan import Answer, AssemblyPlan, Contact, Motion, Segment, Step, Table, Unsolved
from sashimono.verify import VerifyConfig, VerifyReport, verify_file, verify_plan
from sashimono.verify.body import SampledBody
from sashimono.verify.compound import Compound
from sashimono.verify.overlap import intersection

MM = 1e-3
SOURCE = Source(path="here", sha256="5a", unit="mm")
TABLE = Table(normal=np.array([0.0, 0.0, 1.0]), offset=0.0)


def part(name: str, mesh: trimesh.Trimesh) -> Part:
    return Part(
        name=name, vertices_part=np.array(mesh.vertices) * MM, faces=np.array(mesh.faces), T_world_part=np.eye(4)
    )


def box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=size, transform=se3.make(translation=np.array(center)))


def plate_with_hole(hole: float = 10.0) -> trimesh.Trimesh:
    """40 x 40 x 10 mm on the table, with a square hole through its middle."""
    outer = box((40.0, 40.0, 10.0), (0.0, 0.0, 5.0))
    return trimesh.boolean.difference([outer, box((hole, hole, 30.0), (0.0, 0.0, 5.0))], engine="manifold")


def at(x: float, y: float, z: float) -> np.ndarray:
    """Pose that shifts a part from its assembled pose [mm]."""
    return se3.make(translation=np.array([x, y, z]) * MM)


def step(name: str, fixed: tuple[str, ...], poses: list[np.ndarray], **fields: Any) -> Step:
    segments = (Segment(kind="insertion", start=0, stop=len(poses) - 1),) if len(poses) > 1 else ()
    motion = Motion(T_world_part=np.array(poses), segments=segments)
    return Step(part=name, fixed=fixed, motion=motion, **{"contact": None, **fields})


def plan(assembly: Assembly, *steps: Step, **fields: Any) -> AssemblyPlan:
    values: dict[str, Any] = {
        "status": "complete",
        "source": SOURCE,
        "parts": {p.name: p.T_world_part for p in assembly.parts},
        "order": tuple(s.part for s in steps),
        "steps": steps,
        "table": TABLE,
    }
    return AssemblyPlan(**{**values, **fields})


def peg_in_hole(peg_width: float = 10.0) -> Assembly:
    """A peg that goes down to the table through the plate's hole, 30 mm long."""
    peg = box((peg_width, peg_width, 30.0), (0.0, 0.0, 15.0))
    return Assembly(parts=(part("plate", plate_with_hole()), part("peg", peg)), source=SOURCE)


OVER = [at(80, 0, 0), at(80, 0, 60), at(0, 0, 60), at(0, 0, 0)]


def peg_plan(assembly: Assembly, poses: list[np.ndarray] | None = None, **fields: Any) -> AssemblyPlan:
    return plan(assembly, step("plate", (), [np.eye(4)]), step("peg", ("plate",), poses or OVER, **fields))


def refuted(report: VerifyReport, *words: str) -> None:
    text = "\n".join(report.lines())
    assert not report.ok, text
    assert all(word in text for word in words), text


@pytest.mark.parametrize("width", [8.0, 10.0, 10.2], ids=["clearance", "zero clearance", "press fit"])
def test_sound_plans_pass(width: float) -> None:
    assembly = peg_in_hole(width)
    report = verify_plan(peg_plan(assembly), assembly)
    assert report.ok, report.lines()
    assert len(report.lines()) == len(report.steps) + 1


def test_press_fit_may_be_as_deep_as_assembled_and_no_deeper() -> None:
    assembly = peg_in_hole(12.0)  # 1 mm deep on each side, five times the tolerance
    report = verify_plan(peg_plan(assembly), assembly)
    assert report.ok, report.lines()
    assert report.steps[1].max_penetration == pytest.approx(1.0 * MM, rel=0.5)
    aside = [at(80, 0, 0), at(80, 0, 60), at(1.0, 0, 60), at(1.0, 0, 0), at(0, 0, 0)]
    refuted(verify_plan(peg_plan(assembly, aside), assembly), "deep into plate")


def test_path_through_the_wall() -> None:
    assembly = peg_in_hole()
    refuted(verify_plan(peg_plan(assembly, [at(80, 0, 0), at(0, 0, 0)]), assembly), "deep into plate")


def test_off_center_insertion() -> None:
    assembly = peg_in_hole()
    poses = [at(80, 0, 0), at(80, 0, 60), at(0.5, 0, 60), at(0.5, 0, 0), at(0, 0, 0)]
    refuted(verify_plan(peg_plan(assembly, poses), assembly), "deep into plate")


@pytest.mark.parametrize("thickness", [1.0, 0.05])
@pytest.mark.parametrize("shape", ["block", "needle", "ball"])
def test_thin_sheet_between_two_poses(thickness: float, shape: str) -> None:
    """Both poses are free; what lies between is 50 mm of air and a sheet."""
    sheet = box((60.0, 60.0, thickness), (0.0, 0.0, 40.0))
    shapes = {
        "block": box((20.0, 20.0, 20.0), (0.0, 0.0, 10.0)),
        "needle": box((1.0, 1.0, 20.0), (0.0, 0.0, 10.0)),
        "ball": trimesh.creation.icosphere(subdivisions=3, radius=8.0).apply_translation([0.0, 0.0, 10.0]),
    }
    assembly = Assembly(parts=(part("sheet", sheet), part("mover", shapes[shape])), source=SOURCE)
    down = plan(
        assembly, step("sheet", (), [np.eye(4)]), step("mover", ("sheet",), [at(0, 0, 50), at(0, 0, 0)]), table=None
    )
    refuted(verify_plan(down, assembly), "deep into sheet")
    around = [at(0, 0, 50), at(90, 0, 50), at(90, 0, 0), at(0, 0, 0)]
    sound = plan(assembly, step("sheet", (), [np.eye(4)]), step("mover", ("sheet",), around), table=None)
    report = verify_plan(sound, assembly)
    assert report.ok, report.lines()


def test_needle_sideways_through_a_sheet_s_edge_and_sheet_through_sheet() -> None:
    sheet = box((60.0, 60.0, 0.5), (0.0, 0.0, 0.0))
    for mover in (box((1.0, 1.0, 50.0), (0.0, 0.0, 0.0)), box((0.5, 60.0, 60.0), (0.0, 0.0, 0.0))):
        mover.apply_translation([100.0, 0.0, 0.0])
        assembly = Assembly(parts=(part("sheet", sheet), part("mover", mover)), source=SOURCE)
        poses = [at(-200, 0, 0), at(0, 0, 0)]
        bad = plan(assembly, step("sheet", (), [np.eye(4)]), step("mover", ("sheet",), poses), table=None)
        refuted(verify_plan(bad, assembly), "deep into sheet")


def open_box(width: float) -> trimesh.Trimesh:
    outer = box((width, width, 60.0), (0.0, 0.0, 30.0))
    return trimesh.boolean.difference([outer, box((width - 2, width - 2, 60.0), (0, 0, 31.0))], engine="manifold")


def test_thin_shell_through_thin_shell() -> None:
    """1 mm walls, and 2 % of the size is 1.2 mm: no point gets deeper into a wall than that."""
    shell = open_box(60.0)
    other = shell.copy().apply_translation([200.0, 0.0, 0.0])
    assembly = Assembly(parts=(part("first", shell), part("second", other)), source=SOURCE)
    bad = plan(
        assembly, step("first", (), [np.eye(4)]), step("second", ("first",), [at(-170, 13, 7), at(0, 0, 0)]), table=None
    )
    refuted(verify_plan(bad, assembly), "deep into first")


def test_part_inside_a_cavity_s_solid_wall_is_found_without_crossing_surfaces() -> None:
    block = box((60.0, 60.0, 60.0), (0.0, 0.0, 30.0))
    pea = box((2.0, 2.0, 2.0), (100.0, 0.0, 1.0))
    assembly = Assembly(parts=(part("block", block), part("pea", pea)), source=SOURCE)
    bad = plan(
        assembly, step("block", (), [np.eye(4)]), step("pea", ("block",), [at(-100, 0, 20), at(-95, 0, 30)]), table=None
    )
    bad = dataclasses.replace(
        bad,
        steps=(bad.steps[0], step("pea", ("block",), [at(-100, 0, 20), at(0, 0, 100), at(0, 0, 0)])),
    )
    refuted(verify_plan(bad, assembly), "deep into block")


def test_a_turn_between_two_free_poses_sweeps_its_arc() -> None:
    """A beam turned by 120 degrees over a post: free at both ends, and midway along the straight chord."""
    post = box((4.0, 4.0, 20.0), (40.0, 0.0, 10.0))
    beam = box((100.0, 4.0, 4.0), (50.0, 0.0, 10.0))
    turned = {sign: se3.make(se3.exp_so3(np.array([0.0, 0.0, sign * np.pi / 3]))) for sign in (-1, 1)}
    moved = trimesh.Trimesh(beam.vertices, beam.faces).apply_transform(turned[1])
    assembly = Assembly(parts=(part("post", post), part("beam", moved)), source=SOURCE)
    start = turned[-1] @ se3.inverse(turned[1])
    swing = plan(assembly, step("post", (), [np.eye(4)]), step("beam", ("post",), [start, np.eye(4)]), table=None)
    refuted(verify_plan(swing, assembly), "deep into post", "pose 0.")
    lifted = [start, at(0, 0, 30) @ start, at(0, 0, 30), np.eye(4)]
    sound = plan(assembly, step("post", (), [np.eye(4)]), step("beam", ("post",), lifted), table=None)
    assert verify_plan(sound, assembly).ok


def with_third(*, rest_third: np.ndarray | None = None) -> tuple[Assembly, AssemblyPlan]:
    assembly = peg_in_hole()
    cap = part("cap", box((20.0, 20.0, 5.0), (0.0, 0.0, 32.5)))
    assembly = Assembly(parts=(*assembly.parts, cap), source=SOURCE)
    rest = at(0, 80, -30) if rest_third is None else rest_third
    sound = plan(
        assembly,
        step("plate", (), [np.eye(4)]),
        step("peg", ("plate",), OVER),
        step("cap", ("plate", "peg"), [rest, at(0, 80, 60), at(0, 0, 60), at(0, 0, 0)]),
    )
    return assembly, sound


def test_three_parts_pass_and_wrong_order_does_not() -> None:
    assembly, sound = with_third()
    report = verify_plan(sound, assembly)
    assert report.ok, report.lines()
    plate, peg, cap = sound.steps
    early = dataclasses.replace(cap, fixed=("plate",))
    late = dataclasses.replace(peg, fixed=("plate", "cap"))
    swapped = dataclasses.replace(sound, order=("plate", "cap", "peg"), steps=(plate, early, late))
    refuted(verify_plan(swapped, assembly), "peg", "deep into cap")
    lying = dataclasses.replace(sound, order=("plate", "cap", "peg"), steps=(plate, cap, peg))
    refuted(verify_plan(lying, assembly), "placed before")
    refuted(verify_plan(dataclasses.replace(sound, order=("plate", "cap", "peg")), assembly), "follow the order")


def test_resting_parts_overlap_or_are_run_into() -> None:
    assembly, overlapping = with_third(rest_third=at(85, 0, -30))
    refuted(verify_plan(overlapping, assembly), "deep into cap")
    assembly, in_the_way = with_third(rest_third=at(40, 0, -30))
    low = [at(80, 0, 0), at(30, 0, 0), at(30, 0, 60), at(0, 0, 60), at(0, 0, 0)]
    steps = (in_the_way.steps[0], step("peg", ("plate",), low), in_the_way.steps[2])
    refuted(verify_plan(dataclasses.replace(in_the_way, steps=steps), assembly), "deep into cap")
    assembly, on_base = with_third(rest_third=at(15, 0, -30))
    refuted(verify_plan(on_base, assembly), "plate", "deep into cap")


def test_missing_part_and_its_partial_plan() -> None:
    assembly, sound = with_third()
    less = dataclasses.replace(sound, order=sound.order[:2], steps=sound.steps[:2])
    refuted(verify_plan(less, assembly), "'cap' has no step")
    left = Unsolved(part="cap", answer=Answer.UNKNOWN, blocked_by=(), reason="budget")
    partial = dataclasses.replace(less, status="partial", unsolved=(left,))
    assert verify_plan(partial, assembly).ok
    refuted(verify_plan(dataclasses.replace(less, status="partial"), assembly), "neither a step nor a reason")
    refuted(verify_plan(dataclasses.replace(sound, unsolved=(left,)), assembly), "listed as unsolved")
    unlisted = {name: T for name, T in sound.parts.items() if name != "cap"}
    refuted(verify_plan(dataclasses.replace(less, parts=unlisted), assembly), "'cap' of the assembly is missing")


def test_tampered_geometry_poses_and_paths() -> None:
    assembly = peg_in_hole()
    sound = peg_plan(assembly)
    other = Source(path="here", sha256="5b", unit="mm")
    refuted(verify_plan(dataclasses.replace(sound, source=other), assembly), "sha256 differs")
    parts = {**sound.parts, "peg": at(0, 0, 0.1)}
    refuted(verify_plan(dataclasses.replace(sound, parts=parts), assembly), "'peg' is not the one of the assembly")
    refuted(verify_plan(peg_plan(assembly, [*OVER[:-1], at(0, 0, 0.1)]), assembly), "does not end in the assembled")
    sheared = OVER[1].copy()
    sheared[0, 1] = 0.01
    refuted(verify_plan(peg_plan(assembly, [OVER[0], sheared, *OVER[2:]]), assembly), "pose 1 of the path is not rigid")
    mirrored = OVER[1] @ np.diag([1.0, 1.0, -1.0, 1.0])
    refuted(verify_plan(peg_plan(assembly, [OVER[0], mirrored, *OVER[2:]]), assembly), "not rigid")
    refuted(verify_plan(peg_plan(assembly, [np.eye(4)]), assembly), "never moves")
    for segments in ((), ((0, 2),), ((0, 1), (2, 3)), ((0, 3), (3, 3)), ((1, 3),)):
        cover = tuple(Segment(kind="transit", start=a, stop=b) for a, b in segments)
        motion = Motion(T_world_part=np.array(OVER), segments=cover)
        steps = (sound.steps[0], dataclasses.replace(sound.steps[1], motion=motion))
        refuted(verify_plan(dataclasses.replace(sound, steps=steps), assembly), "do not cover")
    moving_base = (step("plate", (), [at(0, 0, 5), np.eye(4)]), sound.steps[1])
    refuted(verify_plan(dataclasses.replace(sound, steps=moving_base), assembly), "base part must have one pose")


def test_starts_that_do_not_rest() -> None:
    assembly = peg_in_hole()
    refuted(verify_plan(peg_plan(assembly, [at(80, 0, 3), *OVER[1:]]), assembly), "floats 3 mm")
    refuted(verify_plan(peg_plan(assembly, [at(80, 0, -3), *OVER[1:]]), assembly), "inside the table")
    on_edge = at(80, 0, 5 * np.sqrt(2)) @ se3.make(se3.exp_so3(np.array([0.0, np.pi / 4, 0.0])))
    assert not verify_plan(peg_plan(assembly, [on_edge, *OVER[1:]]), assembly).ok
    leaning = trimesh.creation.box(extents=(10.0, 10.0, 40.0))
    leaning.apply_translation([0.0, 0.0, 20.0])
    vertices = np.array(leaning.vertices)
    vertices[:, 0] += 0.6 * vertices[:, 2]  # its centre of mass is 12 mm aside, its foot reaches 5 mm
    tower = Part(name="tower", vertices_part=vertices * MM, faces=np.array(leaning.faces), T_world_part=np.eye(4))
    both = Assembly(parts=(part("plate", box((20.0, 20.0, 10.0), (-60.0, 0.0, 5.0))), tower), source=SOURCE)
    tips = plan(both, step("plate", (), [np.eye(4)]), step("tower", ("plate",), [at(80, 0, 0), at(0, 0, 0)]))
    refuted(verify_plan(tips, both), "tips over")


def test_through_the_table() -> None:
    assembly = peg_in_hole()
    under = [at(80, 0, 0), at(80, 0, 60), at(0, 0, 60), at(0, 0, -4), at(0, 0, 0)]
    refuted(verify_plan(peg_plan(assembly, under), assembly), "deep into table")
    below = [at(80, 0, 0), at(80, 0, -60), at(0, 0, -60), at(0, 0, 0)]
    refuted(verify_plan(peg_plan(assembly, below), assembly), "deep into table")


def grasp(**fields: Any) -> Contact:
    """Fingers on the peg's x faces near its top, coming from above."""
    down = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    values: dict[str, Any] = {
        "kind": "grasp",
        "points_part": np.array([[-5.0, 0.0, 25.0], [5.0, 0.0, 25.0]]) * MM,
        "normals_part": np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
        "friction": 0.2,
        "quality": 0.1,
        "T_part_gripper": se3.make(down, np.array([0.0, 0.0, 25.0]) * MM),
        "details": {
            "gripper": {
                "finger_width": 8 * MM,
                "finger_thickness": 4 * MM,
                "finger_length": 40 * MM,
                "max_opening": 30 * MM,
                "palm_width": 40 * MM,
                "palm_depth": 20 * MM,
                "palm_length": 10 * MM,
            }
        },
    }
    return Contact(**{**values, **fields})


def check_grasp(contact: Contact) -> VerifyReport:
    assembly = peg_in_hole()
    return verify_plan(peg_plan(assembly, contact=contact), assembly)


def test_sound_grasp_passes() -> None:
    report = check_grasp(grasp())
    assert report.ok, report.lines()
    assert not report.steps[1].notes


def shifted(x: float, y: float, z: float) -> np.ndarray:
    return grasp().points_part + np.array([x, y, z]) * MM


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"points_part": shifted(0, 0, 10)}, "off the surface"),
        ({"points_part": shifted(1, 0, 0)}, "off the surface"),
        ({"normals_part": 2.0 * grasp().normals_part}, "unit length"),
        ({"normals_part": -grasp().normals_part}, "inward normal"),
        ({"normals_part": np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])}, "inward normal"),
        ({"points_part": np.array([[-5.0, 0.0, 28.0], [5.0, 0.0, 20.0]]) * MM}, "not antipodal"),
        ({"points_part": np.full((2, 3), np.nan)}, "not finite"),
        ({"friction": 0.0}, "friction"),
        ({"T_part_gripper": at(0, 0, 10)}, "fingers on the contacts"),
        ({"details": {"gripper": {**grasp().details["gripper"], "max_opening": 9 * MM}}}, "gripper opens"),
        ({"details": {"gripper": {"finger_width": -1.0}}}, "not a length"),
    ],
)
def test_bad_grasps(fields: dict[str, Any], words: str) -> None:
    refuted(check_grasp(grasp(**fields)), words)


def test_fingers_that_hit_the_plate() -> None:
    low = grasp(
        points_part=shifted(0, 0, -20),
        T_part_gripper=se3.make(grasp().T_part_gripper[:3, :3], np.array([0.0, 0.0, 5.0]) * MM),
    )
    refuted(check_grasp(low), "finger hits plate")


def test_grasp_without_soft_fingers_has_no_closure() -> None:
    assembly = peg_in_hole()
    hard = grasp(details={})
    report = verify_plan(peg_plan(assembly, contact=hard), assembly, config=VerifyConfig(torsion_radius=0.0))
    refuted(report, "no force closure")


def test_no_contact_is_noted_with_its_reason() -> None:
    assembly = peg_in_hole()
    report = verify_plan(peg_plan(assembly, contact_reason="too smooth"), assembly)
    assert report.ok
    assert "too smooth" in report.steps[1].notes[0]


def test_running_out_of_queries_refuses() -> None:
    assembly = peg_in_hole()
    refuted(verify_plan(peg_plan(assembly), assembly, config=VerifyConfig(max_queries=50)), "queries ran out")


def test_moving_the_whole_plan_changes_no_answer() -> None:
    pose = se3.exp(np.array([0.3, -0.2, 0.1, 0.4, 0.9, -0.3]))
    for poses, holds in ((OVER, True), ([at(80, 0, 0), at(0, 0, 0)], False)):
        assembly = peg_in_hole()
        moved = Assembly(parts=tuple(dataclasses.replace(p, T_world_part=pose) for p in assembly.parts), source=SOURCE)
        normal = pose[:3, 2]
        steps = (step("plate", (), [pose]), step("peg", ("plate",), [pose @ T for T in poses]))
        table = Table(normal=normal, offset=float(normal @ pose[:3, 3]))
        assert verify_plan(plan(moved, *steps, table=table), moved).ok is holds


@pytest.mark.parametrize("name", ["peg_blind", "peg_press2pct", "peg_facet_mismatch"])
def test_straight_pull_of_the_truth_pegs(truth_folder: Any, name: str) -> None:
    meshes = {n: trimesh.load(truth_folder / name / f"{n}.obj", process=False) for n in ("plate", "peg")}
    assembly = Assembly(parts=tuple(part(n, mesh) for n, mesh in meshes.items()), source=SOURCE)
    # the facet-mismatch pair is turned: take the plate's thinnest inertia axis
    axis = meshes["plate"].principal_inertia_vectors[int(np.argmax(meshes["plate"].principal_inertia_components))]
    across = np.cross(axis, [1.0, 0.0, 0.0])
    sides = [meshes["peg"].centroid - meshes["plate"].centroid]
    axis = axis * (1.0 if sides[0] @ axis >= 0.0 else -1.0)
    for direction, holds in ((axis, True), (across / np.linalg.norm(across), False)):
        steps = (step("plate", (), [np.eye(4)]), step("peg", ("plate",), [at(*(80.0 * direction)), np.eye(4)]))
        report = verify_plan(plan(assembly, *steps, table=None), assembly)
        assert report.ok is holds, (name, report.lines())


def test_file_is_checked_against_its_input_read_again(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "input"
    folder.mkdir()
    for body in peg_in_hole().parts:
        trimesh.Trimesh(body.vertices_part / MM, body.faces, process=False).export(folder / f"{body.name}.obj")
    assembly = read_assembly(folder, unit="mm")
    assert assembly.source is not None
    source = dataclasses.replace(assembly.source, path="input")
    write_plan(dataclasses.replace(peg_plan(assembly), source=source), tmp_path / "plan.json")
    assert verify_file(tmp_path / "plan.json").ok  # beside the plan
    monkeypatch.chdir(tmp_path)
    assert verify_file("plan.json").ok
    assert verify_file("plan.json", folder).ok
    with pytest.raises(InputError, match="is not there"):
        verify_file("plan.json", tmp_path / "elsewhere")
    box((9.0, 9.0, 30.0), (0.0, 0.0, 15.0)).export(folder / "peg.obj")
    refuted(verify_file("plan.json"), "sha256 differs")


@pytest.mark.parametrize(("pitch", "holds"), [(5.0, True), (4.0, False)])
def test_nut_leaves_a_thread_without_clearance_along_its_pitch_only(
    truth_folder: Any, pitch: float, holds: bool
) -> None:
    meshes = {n: trimesh.load(truth_folder / "thread_clr0" / f"{n}.obj", process=False) for n in ("bolt", "nut")}
    assembly = Assembly(parts=tuple(part(n, mesh) for n, mesh in meshes.items()), source=SOURCE)
    thirds = range(9, -1, -1)
    poses = [
        se3.make(se3.exp_so3(np.array([0.0, 0.0, -k * 2.0 * np.pi / 3.0])), np.array([0.0, 0.0, -k * pitch * MM / 3.0]))
        for k in thirds
    ]
    steps = (step("bolt", (), [np.eye(4)]), step("nut", ("bolt",), poses))
    report = verify_plan(plan(assembly, *steps, table=None), assembly)
    assert report.ok is holds, report.lines()


def test_an_overlap_when_assembled_is_no_pass_through_another_wall() -> None:
    """A peg sunk 3 mm into solid ground may come out of it, but not through a 3 mm wall farther on."""
    ground, wall = box((80.0, 40.0, 5.0), (0.0, 0.0, 2.5)), box((3.0, 40.0, 40.0), (30.0, 0.0, 24.0))
    base = trimesh.boolean.union([ground, wall], engine="manifold")
    peg = box((6.0, 6.0, 20.0), (0.0, 0.0, 12.0))
    assembly = Assembly(parts=(part("base", base), part("peg", peg)), source=SOURCE)

    def report(*poses: np.ndarray) -> VerifyReport:
        steps = step("base", (), [np.eye(4)]), step("peg", ("base",), [*poses, np.eye(4)])
        return verify_plan(plan(assembly, *steps, table=None), assembly)

    assert report(at(0, 0, 50)).ok
    refuted(report(at(80, 0, 20), at(0, 0, 20)), "peg", "mm deep into base")


def test_an_overlap_when_assembled_is_no_pass_through_all_of_the_solid_that_it_is_in() -> None:
    """A peg sunk 3 mm into solid ground does not plough through the ground, although it never goes deeper."""
    base, peg = box((80.0, 40.0, 10.0), (0.0, 0.0, 0.0)), box((6.0, 6.0, 20.0), (0.0, 0.0, 12.0))
    assembly = Assembly(parts=(part("base", base), part("peg", peg)), source=SOURCE)
    for way in (at(80, 0, 0), at(0, 60, 0)):
        steps = step("base", (), [np.eye(4)]), step("peg", ("base",), [way, np.eye(4)])
        refuted(verify_plan(plan(assembly, *steps, table=None), assembly), "too far from where they overlap")


def test_a_bush_with_interference_is_pressed_through_all_of_its_bore() -> None:
    """A bush 0.2 mm too large goes into a bore of 60 mm, at whose end it sits."""
    bore = trimesh.creation.annulus(r_min=10.0, r_max=25.0, height=60.0, sections=64)
    bush = trimesh.creation.cylinder(radius=10.2, height=12.0, sections=64)
    bush.apply_translation([0.0, 0.0, -24.0])
    assembly = Assembly(parts=(part("bore", bore), part("bush", bush)), source=SOURCE)
    steps = step("bore", (), [np.eye(4)]), step("bush", ("bore",), [at(0, 0, 84), np.eye(4)])
    report = verify_plan(plan(assembly, *steps, table=None), assembly)
    assert report.ok, report.lines()


def test_a_compound_weighs_and_measures_as_its_members_together() -> None:
    """A cube of 2 mm and one of 1 mm on top of it, the second in a frame of its own."""
    large, small = box((2.0, 2.0, 2.0), (0.0, 0.0, 0.0)), box((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    bodies = [
        SampledBody(name, np.array(m.vertices) * MM, np.array(m.faces), samples=100)
        for name, m in (("large", large), ("small", small))
    ]
    T = se3.make(se3.exp_so3(np.array([0.0, 0.0, 0.5 * np.pi])), np.array([0.0, 0.0, 1.5 * MM]))
    both = Compound("large", [(bodies[0], np.eye(4)), (bodies[1], T)], samples=100)
    assert both.volume == pytest.approx(9.0 * MM**3)
    np.testing.assert_allclose(both.center_of_mass, [0.0, 0.0, 1.5 / 9.0 * MM], atol=1e-12)
    points = np.array([[0.0, 0.0, 2.25], [0.0, 0.0, 1.5], [1.5, 0.0, 0.0], [0.0, 0.75, 1.5]]) * MM
    np.testing.assert_allclose(both.distance(points), np.array([0.25, -0.5, 0.5, 0.25]) * MM, atol=1e-9)
    np.testing.assert_allclose(both.nearest_normal(points[[0, 2, 3]]), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-9)


def test_the_sign_of_a_distance_is_right_beside_needle_triangles(truth_folder: Any) -> None:
    """The thread's faces are needles: signs as the winding number has them, near the surface and far."""
    nut = read_assembly(truth_folder / "thread_clr0", unit="mm").part("nut")
    body = SampledBody("nut", nut.vertices_part, nut.faces, samples=1000)
    rng = np.random.default_rng(5)
    near = nut.vertices_part[rng.integers(0, len(nut.vertices_part), 400)] + rng.normal(0.0, 1e-4, (400, 3))
    inside = igl.winding_number(nut.vertices_part, nut.faces.astype(np.int64), near) > 0.5
    np.testing.assert_array_equal(body.distance(near) < 0.0, inside)


def test_how_deep_a_peg_is_in_solid_material_is_seen_between_its_corners() -> None:
    block, peg = (trimesh.creation.box(extents=extents) for extents in ((40.0, 20.0, 20.0), (4.0, 4.0, 60.0)))
    bodies = [
        SampledBody(name, np.array(mesh.vertices), np.array(mesh.faces), samples=500)
        for name, mesh in (("peg", peg), ("block", block))
    ]
    assert intersection(bodies[0], bodies[1], np.eye(4)).depth == pytest.approx(10.0, rel=0.05)
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 9.0], [0.0, 0.0, 11.0]])
    np.testing.assert_array_equal(bodies[1].contains(points), bodies[1].distance(points) < 0.0)
