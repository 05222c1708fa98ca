"""plan.json: nothing is lost on the way to disk and back, and broken files say where."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as numpy_strategies

from sashimono.assembly import Overlap, Source
from sashimono.errors import PlanFormatError
from sashimono.io.plan_json import plan_from_json, plan_to_json, read_plan, write_plan
from sashimono.io.plan_schema import plan_schema, refuse_unknown
from sashimono.plan import (
    Answer,
    AssemblyPlan,
    Contact,
    DeclaredHelix,
    Fixture,
    Motion,
    MotionClass,
    Segment,
    Step,
    Subassembly,
    Table,
    Unsolved,
)

numbers = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(min_size=1, max_size=8)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | names,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=6,
)
mappings = st.dictionaries(names, json_values, max_size=3)


def arrays(*shape: int) -> st.SearchStrategy[np.ndarray]:
    return numpy_strategies.arrays(np.float64, shape, elements=numbers)


def recipe(kind: type, /, **fields: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Class and fields, put together later by `made`: the shape checks of the tests draw random numbers."""
    return st.fixed_dictionaries(fields).map(lambda values: (kind, values))


def made(value: Any) -> Any:
    """The value that a recipe describes."""
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[0], type):
        return value[0](**{name: made(item) for name, item in value[1].items()})
    return tuple(made(item) for item in value) if isinstance(value, tuple) else value


contacts = recipe(
    Contact,
    kind=st.sampled_from(["grasp", "push"]),
    points_part=arrays(2, 3),
    normals_part=arrays(2, 3),
    friction=numbers,
    quality=numbers,
    force_part=st.none() | arrays(2, 3),
    T_part_gripper=st.none() | arrays(4, 4),
    details=mappings,
)
single_steps = recipe(
    Step,
    part=names,
    fixed=st.lists(names, max_size=3).map(tuple),
    motion=recipe(
        Motion,
        T_world_part=arrays(2, 4, 4),
        segments=st.lists(
            recipe(
                Segment,
                kind=st.sampled_from(["transit", "insertion"]),
                start=st.integers(0, 9),
                stop=st.integers(0, 9),
            ),
            max_size=2,
        ).map(tuple),
        evidence=mappings,
    ),
    contact=st.none() | contacts,
    contact_reason=st.none() | names,
    declared=st.none()
    | recipe(
        DeclaredHelix,
        axis=arrays(3),
        point=arrays(3),
        pitch=numbers,
        other=names,
        start=st.integers(0, 9),
        stop=st.integers(0, 9),
    ),
    held=st.lists(names, max_size=2).map(tuple),
    hands=st.none() | st.integers(0, 5),
)
fixtures = st.none() | recipe(Fixture, parts=st.lists(names, max_size=2).map(tuple), height=numbers, reason=names)
tables = st.none() | recipe(Table, normal=arrays(3), offset=numbers)


def step_of(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """A step that moves a subassembly, with steps like these inside."""
    inside = recipe(
        Subassembly,
        order=st.lists(names, max_size=2).map(tuple),
        steps=st.lists(inner, max_size=2).map(tuple),
        table=tables,
        fixture=fixtures,
    )
    moving = st.lists(names, min_size=1, max_size=3).map(tuple)
    fields = st.fixed_dictionaries({"moving": moving, "subassembly": inside})
    return st.tuples(single_steps, fields).map(lambda pair: (Step, {**pair[0][1], **pair[1]}))


steps = st.recursive(single_steps, step_of, max_leaves=3)
about_unsolved = {"part": names, "blocked_by": st.lists(names, max_size=2).map(tuple), "reason": names}
plans = recipe(
    AssemblyPlan,
    status=st.sampled_from(["complete", "partial"]),
    source=recipe(Source, path=names, sha256=names, unit=names),
    parts=st.dictionaries(names, arrays(4, 4), max_size=3),
    order=st.lists(names, max_size=3).map(tuple),
    steps=st.lists(steps, max_size=2).map(tuple),
    unsolved=st.lists(
        recipe(
            Unsolved, answer=st.just(Answer.PROVEN_BLOCKED), proven_for=st.sampled_from(MotionClass), **about_unsolved
        )
        | recipe(Unsolved, answer=st.just(Answer.UNKNOWN), **about_unsolved),
        max_size=2,
    ).map(tuple),
    table=tables,
    fixture=fixtures,
    hands=st.integers(1, 4),
    executable=st.none() | st.booleans(),
    overlaps=st.lists(recipe(Overlap, first=names, second=names, volume=numbers, fraction=numbers), max_size=2).map(
        tuple
    ),
    identical=st.lists(st.lists(names, max_size=3).map(tuple), max_size=2).map(tuple),
    notes=st.lists(names, max_size=2).map(tuple),
    config=mappings,
    seed=st.integers(),
    version=names,
    timings=st.dictionaries(names, numbers, max_size=2),
)


def tree(value: Any) -> Any:
    """A value as nested plain types that compare by ==, floats by their bits."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: tree(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, dict):
        return {key: tree(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [tree(item) for item in value]
    return value.hex() if isinstance(value, float) else value


def small_plan(**changes: Any) -> AssemblyPlan:
    lift = np.eye(4)
    lift[2, 3] = 0.1
    motion = Motion(T_world_part=np.array([lift, np.eye(4)]), segments=(Segment(kind="insertion", start=0, stop=1),))
    base = Motion(T_world_part=np.eye(4)[None], segments=())
    fields: dict[str, Any] = {
        "status": "complete",
        "source": Source(path="box", sha256="00", unit="mm"),
        "parts": {"box": np.eye(4), "lid": np.eye(4)},
        "order": ("box", "lid"),
        "steps": (
            Step(part="box", fixed=(), motion=base, contact=None),
            Step(part="lid", fixed=("box",), motion=motion, contact=None, contact_reason="too flat"),
        ),
        "timings": {"motion": 0.25},
    }
    return AssemblyPlan(**{**fields, **changes})


@settings(max_examples=60, deadline=None)
@given(plans)
def test_round_trip_loses_nothing(described: Any) -> None:
    plan = made(described)
    text = plan_to_json(plan)
    again = plan_from_json(text)
    assert tree(again) == tree(plan)
    assert plan_to_json(again) == text


@settings(max_examples=15, deadline=None)
@given(plans)
def test_own_check_and_jsonschema_agree_on_good_plans(described: Any) -> None:
    plan = made(described)
    jsonschema.validate(json.loads(plan_to_json(plan)), plan_schema())


def test_layout_is_one_pose_a_line_and_timings_are_apart() -> None:
    text = plan_to_json(small_plan())
    assert text.count("[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]") == 4
    assert sum("0.1], [0.0, 0.0, 0.0, 1.0]]" in line for line in text.splitlines()) == 1
    other = plan_to_json(small_plan(timings={"motion": 9.0}))
    differing = [a for a, b in zip(text.splitlines(), other.splitlines(), strict=True) if a != b]
    assert len(differing) == 1
    assert "motion" in differing[0]


def test_written_file_reads_back_and_no_temporary_stays(tmp_path: Any) -> None:
    path = tmp_path / "plan.json"
    write_plan(small_plan(), path)
    write_plan(small_plan(seed=7), path)
    assert read_plan(path).seed == 7
    assert [entry.name for entry in tmp_path.iterdir()] == ["plan.json"]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_json_lacks_are_refused_and_nothing_is_written(tmp_path: Any, value: float) -> None:
    pose = np.eye(4)
    pose[0, 3] = value
    with pytest.raises(PlanFormatError, match=r"\$\.parts\[0\]\.T_world_part\[0\]\[3\]"):
        write_plan(small_plan(parts={"box": pose}), tmp_path / "plan.json")
    with pytest.raises(PlanFormatError, match=r"\$\.config\.depth"):
        write_plan(small_plan(config={"depth": np.float64(value)}), tmp_path / "plan.json")
    assert list(tmp_path.iterdir()) == []


def test_free_is_no_answer_for_an_unsolved_part() -> None:
    unsolved = Unsolved(part="lid", answer=Answer.FREE, blocked_by=(), reason="")
    with pytest.raises(PlanFormatError, match=r"\$\.unsolved\[0\]\.answer"):
        plan_to_json(small_plan(unsolved=(unsolved,)))


BREAKS = {
    "$.version": (("version",), 2),
    "$.status": (("status",), "done"),
    "$.unit": (("unit",), "mm"),
    "$.table": (("table",), {"normal": [0, 0], "offset": 0}),
    "$.order[1]": (("order", 1), 5),
    "$.parts: the name 'box' is used twice": (("parts", 1, "name"), "box"),
    "$.parts[0].T_world_part[3]": (("parts", 0, "T_world_part", 3), [0, 0, 1]),
    "$.steps[1].path.T_world_part[0][0][0]": (("steps", 1, "path", "T_world_part", 0, 0, 0), "1"),
    "$.steps[1].path.segments[0].kind": (("steps", 1, "path", "segments", 0, "kind"), "jump"),
    "$.steps[1].path.segments[0].start": (("steps", 1, "path", "segments", 0, "start"), -1),
    "$.steps[0].contact": (("steps", 0, "contact"), {"kind": "grasp"}),
    "$.steps[0].fixed": (("steps", 0, "fixed"), None),
    "$.seed": (("seed",), True),
    "$.steps[0].grippers.some: reason is missing": (("steps", 0, "grippers"), {"some": {"can": True}}),
    "$.steps[0].grippers.some.can": (("steps", 0, "grippers"), {"some": {"can": 1, "reason": None}}),
}


@pytest.mark.parametrize("where", BREAKS)
def test_breaches_are_named_with_their_place(tmp_path: Any, where: str) -> None:
    keys, value = BREAKS[where]
    document = json.loads(plan_to_json(small_plan()))
    spot = document
    for key in keys[:-1]:
        spot = spot[key]
    spot[keys[-1]] = value
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(document))
    with pytest.raises(PlanFormatError) as caught:
        read_plan(path)
    assert where in str(caught.value)
    assert "\n" not in str(caught.value)
    if "twice" not in where:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(document, plan_schema())


@pytest.mark.parametrize(
    ("keys", "value", "says"),
    [
        (("properties", "seed", "maximum"), 9, r"\$\.properties\.seed: .* maximum"),
        (("$defs", "step", "properties", "part", "pattern"), "a", "pattern"),
        (("properties", "seed", "type"), "decimal", "decimal"),
        (("properties", "source", "additionalProperties"), False, "must be a schema"),
    ],
)
def test_a_rule_that_nobody_would_check_is_refused(keys: tuple[str, ...], value: Any, says: str) -> None:
    schema = json.loads(json.dumps(plan_schema()))
    refuse_unknown(schema)
    spot = schema
    for key in keys[:-1]:
        spot = spot[key]
    spot[keys[-1]] = value
    with pytest.raises(ValueError, match=says):
        refuse_unknown(schema)


@pytest.mark.parametrize("name", ["format", "source", "steps", "unsolved", "interpolation", "table"])
def test_missing_fields_are_named(name: str) -> None:
    document = json.loads(plan_to_json(small_plan()))
    del document[name]
    with pytest.raises(PlanFormatError, match=f"{name} is missing"):
        plan_from_json(json.dumps(document))


def test_added_fields_are_read_past() -> None:
    document = json.loads(plan_to_json(small_plan()))
    document["remarks"] = {"by": "someone"}
    document["steps"][1]["duration"] = 2.5
    assert tree(plan_from_json(json.dumps(document))) == tree(small_plan())


def test_breaches_inside_a_subassembly_are_named_with_their_place() -> None:
    document = json.loads(plan_to_json(small_plan()))
    inside = {"order": ["lid"], "table": None, "steps": [{**document["steps"][1], "part": 3}]}
    document["steps"][1] |= {"moving": ["lid", "box"], "subassembly": inside}
    with pytest.raises(PlanFormatError, match=r"\$\.steps\[1\]\.subassembly\.steps\[0\]\.part"):
        plan_from_json(json.dumps(document))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, plan_schema())


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", '{"format": NaN}', "[" * 100000, '{"format": "other"}', "null"])
def test_files_that_are_no_plan(tmp_path: Any, text: str) -> None:
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(PlanFormatError, match=r"plan\.json"):
        read_plan(path)
    with pytest.raises(PlanFormatError, match=r"missing\.json"):
        read_plan(tmp_path / "missing.json")


def test_steps_say_their_way_in_and_older_plans_need_not() -> None:
    from view.view_example import stacked_blocks

    plan, _ = stacked_blocks()
    document = json.loads(plan_to_json(plan))
    assert "direction" not in document["steps"][0]
    step = document["steps"][1]
    assert step["direction"] == pytest.approx([0.0, 0.0, -1.0])
    assert (step["length"], step["turns"]) == (pytest.approx(0.05), 0.0)
    for old in document["steps"][1:]:
        for name in ("direction", "length", "turns"):
            del old[name]
    assert plan_from_json(json.dumps(document)).steps[1].length == pytest.approx(0.05)
