"""The first place where a document breaks plan.schema.json, in one line.

Reads the subset of JSON Schema that the shipped schema uses, so that reading a plan needs no further package.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

_LARGEST = 10**300
"""A whole number much greater than this does not fit into a float."""

_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}

_KEYWORDS = {
    *("$defs", "$ref", "$schema", "additionalProperties", "anyOf", "const", "description", "enum", "items"),
    *("maxItems", "minItems", "minimum", "properties", "required", "title", "type"),
}
"""What this subset knows. A keyword that it passed over would be a rule that nobody checks."""


@cache
def plan_schema() -> dict[str, Any]:
    """Return the JSON Schema of plan.json."""
    text = resources.files("sashimono.io").joinpath("plan.schema.json").read_text(encoding="utf-8")
    schema = json.loads(text)
    refuse_unknown(schema)
    return schema


def refuse_unknown(schema: Mapping[str, Any], where: str = "$") -> None:
    """Raise ValueError, with the place, for a keyword or type in a schema that this subset does not check."""
    if unknown := sorted(set(schema) - _KEYWORDS):
        raise ValueError(f"{where}: the check of plan.json does not know {', '.join(unknown)}")
    if schema.get("type", "object") not in _TYPES:
        raise ValueError(f"{where}.type: the check of plan.json does not know {schema['type']!r}")
    for keyword in ("properties", "$defs"):
        for name, inner in schema.get(keyword, {}).items():
            refuse_unknown(inner, f"{where}.{keyword}.{name}")
    for k, inner in enumerate(schema.get("anyOf", ())):
        refuse_unknown(inner, f"{where}.anyOf[{k}]")
    for keyword in ("items", "additionalProperties"):
        if isinstance(schema.get(keyword), dict):
            refuse_unknown(schema[keyword], f"{where}.{keyword}")
        elif keyword in schema:
            raise ValueError(f"{where}.{keyword}: must be a schema")


def first_violation(document: Any) -> str | None:
    """Return ``JSON path: what is wrong`` for the first thing that breaks the contract, or None.

    Beyond the schema: numbers are finite and part names unique.
    """
    if violation := _check(document, plan_schema(), "$"):
        return violation
    names = [part["name"] for part in document["parts"]]
    doubles = sorted({name for name in names if names.count(name) > 1})
    return f"$.parts: the name {doubles[0]!r} is used twice" if doubles else None


def _check(value: Any, schema: dict[str, Any], where: str) -> str | None:
    if "$ref" in schema and (
        violation := _check(value, plan_schema()["$defs"][schema["$ref"].rsplit("/", 1)[1]], where)
    ):
        return violation
    if "anyOf" in schema:
        # report against the last alternative: the first is null
        if any(_check(value, choice, where) is None for choice in schema["anyOf"]):
            return None
        return _check(value, schema["anyOf"][-1], where)
    if "const" in schema and (value != schema["const"] or isinstance(value, bool)):
        return f"{where}: is {_short(value)}, must be {schema['const']!r}"
    if "enum" in schema and value not in schema["enum"]:
        return f"{where}: is {_short(value)}, must be one of {', '.join(map(repr, schema['enum']))}"
    if "type" in schema and (not _is_of_type(value, schema["type"])):
        return f"{where}: is {_short(value)}, must be of type {schema['type']}"
    if isinstance(value, float) and not math.isfinite(value):
        return f"{where}: is not a finite number"
    if isinstance(value, int) and abs(value) > _LARGEST:
        return f"{where}: is a number beyond all measure"
    if isinstance(value, int) and value < schema.get("minimum", value):
        return f"{where}: is {value}, must be at least {schema['minimum']}"
    if isinstance(value, dict):
        return _check_object(value, schema, where)
    return _check_array(value, schema, where) if isinstance(value, list) else None


def _check_object(value: dict[str, Any], schema: dict[str, Any], where: str) -> str | None:
    for name in schema.get("required", ()):
        if name not in value:
            return f"{where}: {name} is missing"
    for name, inner in schema.get("properties", {}).items():
        if name in value and (violation := _check(value[name], inner, f"{where}.{name}")):
            return violation
    if "additionalProperties" in schema:
        for name in sorted(value.keys() - schema.get("properties", {}).keys()):
            if violation := _check(value[name], schema["additionalProperties"], f"{where}.{name}"):
                return violation
    return None


def _is_of_type(value: Any, kind: str) -> bool:
    """Return whether a value is of a JSON type; true and false are no numbers."""
    return isinstance(value, _TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))


def _check_array(value: list[Any], schema: dict[str, Any], where: str) -> str | None:
    low, high = schema.get("minItems", 0), schema.get("maxItems", math.inf)
    if not low <= len(value) <= high:
        needed = f"{low}" if low == high else f"at least {low}"
        return f"{where}: has {len(value)} items, must have {needed}"
    if "items" in schema:
        for k, item in enumerate(value):
            if violation := _check(item, schema["items"], f"{where}[{k}]"):
                return violation
    return None


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
