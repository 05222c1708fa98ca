"""plan.json: plans written and read without loss. The layout is a contract; see plan.schema.json."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sashimono.assembly import Kept, Overlap, Product, Source, StandIn
from sashimono.errors import PlanFormatError
from sashimono.files import atomic_write
from sashimono.io.plan_schema import first_violation
from sashimono.plan import (
    Alternative,
    Answer,
    AssemblyPlan,
    CloseFit,
    Contact,
    DeclaredFit,
    DeclaredHelix,
    Fastening,
    Fixture,
    Motion,
    MotionClass,
    OrderCost,
    PlannedProduct,
    Segment,
    Step,
    Subassembly,
    Table,
    Tool,
    ToolSpace,
    Unsolved,
)

FORMAT = "sashimono.plan"
VERSION = 1


def write_plan(plan: AssemblyPlan, path: str | Path) -> None:
    """Write a plan as plan.json, whole or not at all: to a temporary name beside it, then renamed.

    The same plan gives the same bytes. Raises PlanFormatError if a value has no place in JSON (NaN, infinity, or
    an object that is no number, text, list or mapping) or breaks the contract; then nothing is written.
    """
    text = plan_to_json(plan)
    with atomic_write(path) as scratch:
        scratch.write_text(text, encoding="utf-8", newline="\n")


def read_plan(path: str | Path) -> AssemblyPlan:
    """Read a plan.json.

    Raises PlanFormatError, one line with the place inside the file, if it is no JSON, or breaks the contract.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PlanFormatError(f"{path}: cannot be read as a plan ({error}).") from error
    try:
        return plan_from_json(text)
    except PlanFormatError as error:
        raise PlanFormatError(f"{path}: {error}") from error


def plan_to_json(plan: AssemblyPlan) -> str:
    """Return the text of plan.json: one pose a line, floats in their shortest form that reads back the same."""
    document = _plain(_document(plan), "$")
    if violation := first_violation(document):
        raise PlanFormatError(violation)
    return "".join(_layout(document, 0)) + "\n"


def plan_from_json(text: str) -> AssemblyPlan:
    """Return the plan in the text of a plan.json; raises PlanFormatError with the JSON path of what is wrong."""
    try:
        document = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise PlanFormatError(f"not JSON: {error}") from error
    if violation := first_violation(document):
        raise PlanFormatError(violation)
    return _plan(document)


def _refuse_constant(name: str) -> float:
    raise PlanFormatError(f"{name} is not a number in JSON")


def _document(plan: AssemblyPlan) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "status": plan.status,
        "unit": "m",
        "source": {
            "path": plan.source.path,
            "sha256": plan.source.sha256,
            "unit": plan.source.unit,
            "split": plan.source.split,
            **({"excluded": plan.source.excluded} if plan.source.excluded else {}),
            **_tree_document(plan.source),
        },
        "interpolation": "geodesic",
        "table": _table_document(plan.table),
        **_executable_document(plan),
        "parts": [{"name": name, "T_world_part": T} for name, T in plan.parts.items()],
        **({"products": [_product_document(entry) for entry in plan.products]} if plan.products else {}),
        "order": plan.order,
        "steps": [_step_document(step) for step in plan.steps],
        "unsolved": [_unsolved_document(entry) for entry in plan.unsolved],
        **({"fits": [_fit_document(fit) for fit in plan.fits]} if plan.fits else {}),
        "overlaps": [
            {"first": o.first, "second": o.second, "volume": o.volume, "fraction": o.fraction} for o in plan.overlaps
        ],
        "identical": plan.identical,
        "notes": plan.notes,
        "seed": plan.seed,
        "sashimono_version": plan.version,
        "config": plan.config,
        "timings": plan.timings,
    }


def _tree_document(source: Source) -> dict[str, Any]:
    """The product tree of the file, where it has one, and what was kept together of it."""
    out: dict[str, Any] = {}
    if source.products:
        out["products"] = [{"name": product.name, "parts": product.parts} for product in source.products]
    if source.kept:
        out["kept"] = [
            {"product": e.product, "reason": e.reason, **({"members": e.members} if e.members else {})}
            for e in source.kept
        ]
    if source.stand_ins:
        out["stand_ins"] = [
            {"part": entry.part, "problem": entry.problem, "how": entry.how, "off": entry.off}
            for entry in source.stand_ins
        ]
    return out


def _executable_document(plan: AssemblyPlan) -> dict[str, Any]:
    """What was found of support and gravity, as far as these were looked at."""
    out: dict[str, Any] = {"hands": plan.hands}
    if plan.fixture is not None:
        out["fixture"] = _fixture_document(plan.fixture)
    if plan.executable is not None:
        out["executable"] = plan.executable
    if plan.cost is not None:
        out["cost"] = {"total": plan.cost.total, "terms": plan.cost.terms, "weights": plan.cost.weights}
    return out


def _product_document(entry: PlannedProduct) -> dict[str, Any]:
    out: dict[str, Any] = {"name": entry.name, "parts": entry.parts, "planned": entry.planned}
    if entry.reason:
        out["reason"] = entry.reason
    return out


def _fit_document(fit: DeclaredFit) -> dict[str, Any]:
    return {"parts": fit.parts, "kind": fit.kind, "depth": fit.depth, "reason": fit.reason}


def _alternative_document(entry: Alternative) -> dict[str, Any]:
    out: dict[str, Any] = {"part": entry.part, "possible": entry.possible, "reason": entry.reason}
    if entry.more is not None:
        out["more"] = entry.more
    return out


def _fixture_document(fixture: Fixture) -> dict[str, Any]:
    return {"parts": fixture.parts, "height": fixture.height, "reason": fixture.reason}


def _unsolved_document(entry: Unsolved) -> dict[str, Any]:
    out: dict[str, Any] = {
        "part": entry.part,
        "answer": entry.answer.value,
        "blocked_by": entry.blocked_by,
        "reason": entry.reason,
    }
    if entry.proven_for is not None:
        out["proven_for"] = entry.proven_for.value
    return out


def _step_document(step: Step) -> dict[str, Any]:
    segments = [{"kind": s.kind, "start": s.start, "stop": s.stop} for s in step.motion.segments]
    out: dict[str, Any] = {
        "part": step.part,
        "fixed": step.fixed,
        "path": {"T_world_part": step.motion.T_world_part, "segments": segments},
        "contact": None if step.contact is None else _contact_document(step.contact),
        "contact_reason": step.contact_reason,
        "evidence": step.motion.evidence,
    }
    if step.direction is not None:
        # rounded: they follow from the path, which is exact
        out["direction"] = np.round(step.direction, 9) + 0.0
        out["length"] = round(step.length, 12)
        out["turns"] = round(step.turns, 9) + 0.0
    if step.motion.times is not None:
        out["path"]["times"] = step.motion.times
    if step.carry is not None:
        out["carry"] = _contact_document(step.carry)
    if step.grippers:
        out["grippers"] = {name: {"can": said is None, "reason": said} for name, said in step.grippers.items()}
    if step.declared is not None:
        out["declared"] = _declared_document(step.declared)
    if step.held:
        out["held"] = step.held
    if step.hands is not None:
        out["hands"] = step.hands
    if step.table is not None:
        out["turned"] = True
        out["table"] = _table_document(step.table)
        if step.held_before:
            out["held_before"] = step.held_before
    if step.fastener is not None:
        fastener = step.fastener
        out["fastener"] = {name: getattr(fastener, name) for name in ("kind", "size", "axis", "point", "joins")}
    if step.close_fits:
        out["close_fits"] = [
            {"part": f.part, "with": f.other, "axis": f.axis, "point": f.point} for f in step.close_fits
        ]
    if step.tool is not None:
        out["tool"] = _tool_document(step.tool)
        out["tool_access"] = step.tool.access
    if step.alternatives is not None:
        out["alternatives"] = [_alternative_document(entry) for entry in step.alternatives]
    if step.simultaneous:
        out["simultaneous"] = step.simultaneous
    if step.moving:
        out["moving"] = step.moving
    if step.subassembly is not None:
        inside = step.subassembly
        out["subassembly"] = {
            **({} if inside.product is None else {"product": inside.product}),
            "order": inside.order,
            "table": _table_document(inside.table),
            "steps": [_step_document(inner) for inner in inside.steps],
        }
        if inside.fixture is not None:
            out["subassembly"]["fixture"] = _fixture_document(inside.fixture)
    return out


def _tool_document(tool: Tool) -> dict[str, Any]:
    out: dict[str, Any] = {"name": tool.name, "kind": tool.kind, "size": tool.size, "reason": tool.reason}
    space = []
    for piece in tool.space:
        entry: dict[str, Any] = {"low": piece.low, "high": piece.high, "radius": piece.radius}
        if piece.toward is not None:
            entry |= {"toward": piece.toward, "angle": piece.angle}
        space.append(entry)
    return {**out, "space": space}


def _declared_document(declared: DeclaredHelix) -> dict[str, Any]:
    return {
        "kind": "helix",
        "axis": declared.axis,
        "point": declared.point,
        "pitch": declared.pitch,
        "with": declared.other,
        "start": declared.start,
        "stop": declared.stop,
    }


def _table_document(table: Table | None) -> dict[str, Any] | None:
    return None if table is None else {"normal": table.normal, "offset": table.offset}


def _contact_document(contact: Contact) -> dict[str, Any]:
    out: dict[str, Any] = {
        "kind": contact.kind,
        "points_part": contact.points_part,
        "normals_part": contact.normals_part,
        "friction": contact.friction,
        "quality": contact.quality,
    }
    if contact.force_part is not None:
        out["force_part"] = contact.force_part
    if contact.T_part_gripper is not None:
        out["T_part_gripper"] = contact.T_part_gripper
    out["details"] = contact.details
    return out


def _plain(value: Any, where: str) -> Any:
    """Return the value in JSON's own types; raises PlanFormatError where it has none."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | str | int):
        return str(value) if isinstance(value, str) else value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise PlanFormatError(f"{where}: {value} cannot be written as JSON")
        return value
    if isinstance(value, Mapping):
        if bad := [key for key in value if not isinstance(key, str)]:
            raise PlanFormatError(f"{where}: key {bad[0]!r} is not text")
        return {str(key): _plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, Sequence):
        return [_plain(item, f"{where}[{k}]") for k, item in enumerate(value)]
    raise PlanFormatError(f"{where}: a {type(value).__name__} cannot be written as JSON")


def _layout(value: Any, indent: int) -> Iterator[str]:
    """Yield JSON text: mappings and lists of mappings broken over lines, poses one a line, short things in line."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if not isinstance(value, dict | list) or not value or (len(flat) + indent <= 100 and not _has_mapping(value)):
        yield flat
        return
    if isinstance(value, list) and (_is_matrix(value) or not any(isinstance(item, dict | list) for item in value)):
        yield flat
        return
    pad = " " * (indent + 1)
    opening, closing = ("{", "}") if isinstance(value, dict) else ("[", "]")
    items = value.items() if isinstance(value, dict) else ((None, item) for item in value)
    yield opening
    for k, (key, item) in enumerate(items):
        yield f"{',' if k else ''}\n{pad}"
        if key is not None:
            yield f"{json.dumps(key, ensure_ascii=False)}: "
        yield from _layout(item, indent + 1)
    yield f"\n{' ' * indent}{closing}"


def _has_mapping(value: Any) -> bool:
    items = value.values() if isinstance(value, dict) else value
    return any(
        isinstance(item, dict | list) and item and (isinstance(item, dict) or _has_mapping(item)) for item in items
    )


def _is_matrix(value: list[Any]) -> bool:
    return all(isinstance(row, list) and not any(isinstance(cell, dict | list) for cell in row) for row in value)


def _plan(document: Mapping[str, Any]) -> AssemblyPlan:
    source = document["source"]
    return AssemblyPlan(
        status=document["status"],
        source=Source(
            path=source["path"],
            sha256=source["sha256"],
            unit=source["unit"],
            split=source.get("split", "none"),
            excluded=tuple(source.get("excluded", ())),
            products=_each(source.get("products", ()), lambda p: Product(name=p["name"], parts=tuple(p["parts"]))),
            stand_ins=_each(
                source.get("stand_ins", ()),
                lambda s: StandIn(part=s["part"], problem=s["problem"], how=s["how"], off=float(s["off"])),
            ),
            kept=_each(
                source.get("kept", ()),
                lambda k: Kept(product=k["product"], reason=k["reason"], members=tuple(k.get("members", ()))),
            ),
        ),
        parts={part["name"]: np.array(part["T_world_part"], dtype=np.float64) for part in document["parts"]},
        products=_each(
            document.get("products", ()),
            lambda p: PlannedProduct(
                name=p["name"], parts=tuple(p["parts"]), planned=p["planned"], reason=p.get("reason", "")
            ),
        ),
        order=tuple(document["order"]),
        steps=tuple(_step(step) for step in document["steps"]),
        unsolved=_each(document["unsolved"], _unsolved),
        table=_table(document["table"]),
        fixture=_fixture(document.get("fixture")),
        hands=document.get("hands", 2),
        executable=document.get("executable"),
        cost=_cost(document.get("cost")),
        fits=_each(
            document.get("fits", ()),
            lambda f: DeclaredFit(
                parts=(f["parts"][0], f["parts"][1]), kind=f["kind"], depth=f["depth"], reason=f["reason"]
            ),
        ),
        overlaps=_each(
            document.get("overlaps", ()),
            lambda o: Overlap(first=o["first"], second=o["second"], volume=o["volume"], fraction=o["fraction"]),
        ),
        identical=_each(document.get("identical", ()), tuple),
        notes=tuple(document.get("notes", ())),
        config=document.get("config", {}),
        seed=document.get("seed", 0),
        version=document.get("sashimono_version", ""),
        timings=document.get("timings", {}),
    )


def _triple(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _each(items: Sequence[Any], make: Callable[[Any], Any]) -> tuple[Any, ...]:
    return tuple(make(item) for item in items)


def _step(step: Mapping[str, Any]) -> Step:
    path, contact = step["path"], step["contact"]
    return Step(
        part=step["part"],
        fixed=tuple(step["fixed"]),
        motion=Motion(
            T_world_part=np.array(path["T_world_part"], dtype=np.float64),
            segments=_each(path["segments"], lambda s: Segment(kind=s["kind"], start=s["start"], stop=s["stop"])),
            evidence=step["evidence"],
            times=None if path.get("times") is None else np.array(path["times"], dtype=np.float64),
        ),
        contact=None if contact is None else _contact(contact),
        contact_reason=step.get("contact_reason"),
        carry=None if step.get("carry") is None else _contact(step["carry"]),
        grippers={name: said["reason"] for name, said in step.get("grippers", {}).items()},
        moving=tuple(step.get("moving", ())),
        subassembly=_subassembly(step["subassembly"]) if step.get("subassembly") is not None else None,
        simultaneous=tuple(step.get("simultaneous", ())),
        declared=_declared(step.get("declared")),
        held=tuple(step.get("held", ())),
        hands=step.get("hands"),
        table=_turned(step),
        held_before=tuple(step.get("held_before", ())),
        fastener=_fastening(step.get("fastener")),
        close_fits=_each(
            step.get("close_fits", ()),
            lambda f: CloseFit(part=f["part"], other=f["with"], axis=_triple(f["axis"]), point=_triple(f["point"])),
        ),
        tool=_tool(step.get("tool"), access=step.get("tool_access", False)),
        alternatives=None
        if step.get("alternatives") is None
        else _each(
            step["alternatives"],
            lambda a: Alternative(part=a["part"], possible=a["possible"], more=a.get("more"), reason=a["reason"]),
        ),
    )


def _turned(step: Mapping[str, Any]) -> Table | None:
    """The table onto which the product is turned over before a step."""
    if step.get("turned", False) != (step.get("table") is not None):
        raise PlanFormatError(f"$.steps: {step['part']!r} must have both turned and a table, or neither")
    return _table(step.get("table"))


def _fastening(fastener: Mapping[str, Any] | None) -> Fastening | None:
    if fastener is None:
        return None
    x, y, z = fastener["axis"]
    u, v, w = fastener["point"]
    return Fastening(
        kind=fastener["kind"],
        size=fastener["size"],
        axis=(float(x), float(y), float(z)),
        point=(float(u), float(v), float(w)),
        joins=tuple(fastener["joins"]),
    )


def _tool(tool: Mapping[str, Any] | None, *, access: bool) -> Tool | None:
    if tool is None:
        return None
    return Tool(
        name=tool["name"],
        kind=tool["kind"],
        size=tool["size"],
        access=access,
        reason=tool["reason"],
        space=_each(
            tool["space"],
            lambda piece: ToolSpace(
                low=float(piece["low"]),
                high=float(piece["high"]),
                radius=float(piece["radius"]),
                toward=None if piece.get("toward") is None else _triple(piece["toward"]),
                angle=None if piece.get("angle") is None else float(piece["angle"]),
            ),
        ),
    )


def _cost(cost: Mapping[str, Any] | None) -> OrderCost | None:
    return None if cost is None else OrderCost(total=cost["total"], terms=cost["terms"], weights=cost["weights"])


def _subassembly(inside: Mapping[str, Any]) -> Subassembly:
    return Subassembly(
        product=inside.get("product"),
        order=tuple(inside["order"]),
        steps=tuple(_step(step) for step in inside["steps"]),
        table=_table(inside["table"]),
        fixture=_fixture(inside.get("fixture")),
    )


def _fixture(fixture: Mapping[str, Any] | None) -> Fixture | None:
    if fixture is None:
        return None
    return Fixture(parts=tuple(fixture["parts"]), height=float(fixture["height"]), reason=fixture["reason"])


def _declared(declared: Mapping[str, Any] | None) -> DeclaredHelix | None:
    if declared is None:
        return None
    return DeclaredHelix(
        axis=np.array(declared["axis"], dtype=np.float64),
        point=np.array(declared["point"], dtype=np.float64),
        pitch=declared["pitch"],
        other=declared["with"],
        start=declared["start"],
        stop=declared["stop"],
    )


def _unsolved(document: Mapping[str, Any]) -> Unsolved:
    answer = Answer(document["answer"])
    # plans from before the field was written have proofs of translations only
    proven = MotionClass(document.get("proven_for", MotionClass.TRANSLATIONS))
    return Unsolved(
        part=document["part"],
        answer=answer,
        blocked_by=tuple(document["blocked_by"]),
        reason=document["reason"],
        proven_for=proven if answer is Answer.PROVEN_BLOCKED else None,
    )


def _table(table: Mapping[str, Any] | None) -> Table | None:
    return None if table is None else Table(normal=np.array(table["normal"]), offset=float(table["offset"]))


def _contact(contact: Mapping[str, Any]) -> Contact:
    def array(name: str) -> np.ndarray | None:
        return np.array(contact[name], dtype=np.float64) if contact.get(name) is not None else None

    return Contact(
        kind=contact["kind"],
        points_part=np.array(contact["points_part"], dtype=np.float64).reshape(-1, 3),
        normals_part=np.array(contact["normals_part"], dtype=np.float64).reshape(-1, 3),
        friction=contact["friction"],
        quality=contact["quality"],
        force_part=array("force_part"),
        T_part_gripper=array("T_part_gripper"),
        details=contact.get("details", {}),
    )
