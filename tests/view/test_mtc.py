"""The task for MoveIt: data against the plan, and the script against stand-ins for MoveIt that note what it asks."""

from __future__ import annotations

import itertools
import json
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from view_example import NAMES, paired_blocks, stacked_blocks

from sashimono.geometry import se3
from sashimono.view.mtc import hand_poses, insertion_poses, mtc_data, write_mtc


def pose_of(values: list[float]) -> np.ndarray:
    return se3.make(Rotation.from_quat(values[3:]).as_matrix(), np.array(values[:3]))


def test_the_data_are_those_of_the_plan() -> None:
    plan, assembly = stacked_blocks()
    data = mtc_data(plan, assembly)
    assert [part["name"] for part in data["parts"]] == list(NAMES)
    for part in data["parts"]:
        step = next(step for step in plan.steps if step.part == part["name"])
        np.testing.assert_allclose(pose_of(part["start"]), step.motion.T_world_part[0], atol=1e-8)
    base, first, pushed, _ = data["steps"]
    assert base["by_hand"] == "stands in place from the beginning"
    assert "no grasp here (no antipodal pair is free)" in pushed["by_hand"]
    assert first["by_hand"] is None
    np.testing.assert_allclose(pose_of(first["way"][0]), plan.steps[1].motion.T_world_part[2], atol=1e-8)
    np.testing.assert_allclose(pose_of(first["way"][-1]), plan.parts[NAMES[1]], atol=1e-8)
    assert first["touches"] == [NAMES[0]]
    # the plan has the gripper's pose here
    assert plan.steps[1].contact is not None
    np.testing.assert_allclose(pose_of(first["grasps"][0]), plan.steps[1].contact.T_part_gripper, atol=1e-8)


def test_fingertips_may_come_from_any_side_from_above_first() -> None:
    plan, _ = stacked_blocks()
    contact = plan.steps[3].contact
    assert contact is not None
    resting = plan.steps[3].motion.T_world_part[0]
    found = hand_poses(contact, resting, np.array([0.0, 0.0, 1.0]))
    assert len(found) == 12
    along = contact.points_part[1] - contact.points_part[0]
    for T in found:
        np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        np.testing.assert_allclose(T[:3, 0], along / np.linalg.norm(along), atol=1e-12)
        np.testing.assert_allclose(T[:3, 3], contact.points_part.mean(axis=0), atol=1e-12)
    rises = [float((resting[:3, :3] @ T[:3, 2])[2]) for T in found]
    assert rises[0] == pytest.approx(min(rises))
    assert rises[0] == pytest.approx(-1.0)


def test_turns_are_cut_so_that_straight_interpolation_follows_them() -> None:
    plan, _ = stacked_blocks()
    step = plan.steps[1]
    turned = step.motion.T_world_part.copy()
    turned[2] = turned[3] @ se3.exp(np.array([0.0, 0.0, 0.01, 0.0, 0.0, 3.0]))
    object.__setattr__(step.motion, "T_world_part", turned)
    way = insertion_poses(step)
    assert len(way) == 7
    for a, b in itertools.pairwise(way):
        assert np.linalg.norm(se3.log(se3.inverse(a) @ b)[3:]) <= np.radians(30.0) + 1e-9
    np.testing.assert_allclose(way[-1], turned[3], atol=1e-12)


def test_a_subassembly_is_left_to_a_person() -> None:
    plan, assembly = paired_blocks()
    last = mtc_data(plan, assembly)["steps"][-1]
    assert "put together block_2, block_3 first" in last["by_hand"]
    assert set(last["placed"]) == {"block_2", "block_3"}


class Message(SimpleNamespace):
    """A message of ROS: fields by name."""

    ADD = b"\x00"

    def __init__(self, **fields: Any) -> None:
        empty: dict[str, Any] = {name: [] for name in ("meshes", "mesh_poses", "vertices", "triangles")}
        super().__init__(**{"header": SimpleNamespace(frame_id=""), **empty, **fields})


class Stage:
    """A stage that notes what was asked of it."""

    def __init__(self, kind: str, *arguments: Any) -> None:
        self.kind, self.calls, self.inside = kind, [], []
        self.name = next((a for a in arguments if isinstance(a, str)), kind)
        self.children = [a for a in arguments if isinstance(a, Stage)]
        self.properties = SimpleNamespace(configureInitFrom=lambda *a: self.calls.append(("configureInitFrom", a)))

    def insert(self, stage: Stage) -> None:
        self.inside.append(stage)

    add = insert

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *arguments: self.calls.append((name, arguments))


class Task(Stage):
    done: list[Task] = []  # noqa: RUF012

    def __init__(self) -> None:
        super().__init__("Task")
        self.solutions = ["best"]

    def __getitem__(self, name: str) -> Stage:
        return next(stage for stage in self.inside if stage.name == name)

    def plan(self) -> bool:
        Task.done.append(self)
        return True


def stand_ins() -> dict[str, ModuleType]:
    """Return modules in place of those of ROS 2 and MoveIt."""
    modules = {}
    for name in (
        "rclcpp", "geometry_msgs", "geometry_msgs.msg", "moveit", "moveit.task_constructor", "moveit_msgs",
        "moveit_msgs.msg", "shape_msgs", "shape_msgs.msg", "std_msgs", "std_msgs.msg",
    ):  # fmt: skip
        modules[name] = ModuleType(name)
    modules["rclcpp"].__dict__.update(init=lambda: None, Node=lambda name: name)
    for name in ("Point", "Pose", "PoseStamped", "Quaternion", "Vector3", "Vector3Stamped"):
        setattr(modules["geometry_msgs.msg"], name, Message)
    modules["moveit_msgs.msg"].__dict__["CollisionObject"] = Message
    modules["shape_msgs.msg"].__dict__.update(Mesh=Message, MeshTriangle=Message)
    modules["std_msgs.msg"].__dict__["Header"] = Message

    def maker(kind: str) -> Any:
        return lambda *arguments: Stage(kind, *arguments)

    kinds = ("PipelinePlanner", "CartesianPath", "JointInterpolationPlanner", "Alternatives", "SerialContainer")
    source = SimpleNamespace(PropertyInitializerSource=SimpleNamespace(INTERFACE="interface"))
    core = SimpleNamespace(Task=Task, Stage=source, **{kind: maker(kind) for kind in kinds})

    class Stages:
        def __getattr__(self, kind: str) -> Any:
            return (lambda *a: Stage(kind, "current")) if kind == "CurrentState" else maker(kind)

    modules["moveit.task_constructor"].__dict__.update(core=core, stages=Stages())
    return modules


def test_the_script_asks_moveit_for_each_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, assembly = stacked_blocks()
    names = write_mtc(plan, assembly, tmp_path)
    assert names == ("assemble.py", "steps.json", *(f"part_{k:03}.obj" for k in range(4)))
    assert json.loads((tmp_path / "steps.json").read_text(encoding="utf-8"))["format"] == "sashimono.mtc"
    for name, module in stand_ins().items():
        monkeypatch.setitem(sys.modules, name, module)
    Task.done.clear()
    product = [0.5, 0.1, 0.0, 0.0, 0.0, float(np.sin(np.pi / 4)), float(np.cos(np.pi / 4))]
    arguments = ["--arm", "arm", "--hand", "hand", "--hand-frame", "palm", "--hand-links", "left", "right", "--execute"]
    monkeypatch.setattr(sys, "argv", ["assemble.py", *arguments, "--product", *map(str, product)])
    monkeypatch.setattr("builtins.input", lambda _: "")
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(tmp_path / "assemble.py"), run_name="__main__")
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert "1 block_0: stands in place" in said
    assert "3 block_2: the plan has no grasp here" in said
    tasks = [task.name for task in Task.done]
    assert tasks[0] == "parts"
    assert "2 block_1" in tasks
    assert "4 block_3" in tasks
    task = next(task for task in Task.done if task.name == "4 block_3")
    assert [stage.kind for stage in task.inside] == [
        "CurrentState", "MoveTo", "Connect", "SerialContainer", "Connect", "SerialContainer",
    ]  # fmt: skip
    pick, put = task.inside[3], task.inside[5]
    assert [stage.kind for stage in pick.inside] == [
        "MoveRelative", "Alternatives", "ModifyPlanningScene", "MoveTo", "ModifyPlanningScene", "ModifyPlanningScene",
        "MoveRelative",
    ]  # fmt: skip
    assert len(pick.inside[1].inside) == 12
    generator = pick.inside[1].inside[0].children[0]
    assert generator.pose.header.frame_id == "block_3", "grasps are in the part's own frame"
    # the way in ends where the plan has the part, in the robot's world
    goal = next(call for call in put.inside[1].calls if call[0] == "setGoal")[1][0]
    assert goal.header.frame_id == "world"
    wanted = pose_of(product) @ plan.parts["block_3"]
    at, turn = goal.pose.position, goal.pose.orientation
    np.testing.assert_allclose(pose_of([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]), wanted, atol=1e-8)
    assert ("detachObjects", (["block_3"], "palm")) in put.inside[-3].calls
    # each part was put into the scene with its mesh
    added = [call[1][0] for call in Task.done[0].inside[-1].calls if call[0] == "addObject"]
    assert [found.id for found in added] == list(NAMES)
    assert [(len(f.meshes[0].vertices), len(f.meshes[0].triangles)) for f in added] == [(8, 12)] * 4
