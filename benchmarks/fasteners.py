"""Precision and recall of recognised fasteners, by kind, on the labelled parts of the real set.

    python benchmarks/fasteners.py [PATTERN ...] [--all] [--json FILE]

The labels (tests/fasteners/labels.json) were given by hand from names, pictures and dimensions, after the recogniser's
first output had been seen, and its limits were set on the same parts: no forecast for other CAD. Parts left in doubt
have no label: plain pins of two-part sets (pin or shaft?), heat-set inserts, barrel nuts. With
--all, what is found in assemblies and parts without labels is listed too, to be looked at.
"""

from __future__ import annotations

import json
from collections import Counter

from common import REPOSITORY, SHARED, chosen, machine, parser, table, write_json

from sashimono.errors import SashimonoError
from sashimono.fasteners.recognise import find_fasteners
from sashimono.io.read import read_assembly

LABELS = REPOSITORY / "tests" / "fasteners" / "labels.json"
KINDS = ("screw", "bolt", "nut", "washer", "pin", "standoff", "circlip")
NONE = "none"


def main() -> None:
    arguments = parser(__doc__, "fasteners.json")
    arguments.add_argument("--all", action="store_true", help="also list what is found where there are no labels")
    options = arguments.parse_args()
    labels = json.loads(LABELS.read_text())
    pairs: Counter[tuple[str, str]] = Counter()
    for folder in chosen(SHARED / "assemblies", options.names):
        own = labels.get(folder.name, {})
        if not own and not options.all:
            continue
        try:
            assembly = read_assembly(folder, unit="mm")
        except SashimonoError as error:
            # a part that cannot be read is one that is not found
            print(f"{folder.name}: {error}")
            pairs.update((label, NONE) for label in own.values())
            continue
        found = {f.part: f.kind for f in find_fasteners(assembly)}
        absent = sorted(own.keys() - set(assembly.names))
        if absent:
            raise SystemExit(f"{folder.name}: labels for parts that it has not: {', '.join(absent)}")
        for name, label in own.items():
            kind = found.get(name, NONE)
            pairs[label, kind] += 1
            if kind != label:
                print(f"{folder.name}/{name}: {label}, found as {kind}")
        if options.all:
            for name in sorted(found.keys() - own.keys()):
                print(f"{folder.name}/{name}: no label, found as {found[name]}")
    rows, figures = [], {}
    for kind in KINDS:
        right = pairs[kind, kind]
        said = sum(n for (_, found_kind), n in pairs.items() if found_kind == kind)
        true = sum(n for (label, _), n in pairs.items() if label == kind)
        figures[kind] = {"labelled": true, "found": said, "right": right}
        rows.append((kind, true, said, share(right, said), share(right, true)))
    right = sum(figures[kind]["right"] for kind in KINDS)
    said, true = (sum(figures[kind][key] for kind in KINDS) for key in ("found", "labelled"))
    rows.append(("all", true, said, share(right, said), share(right, true)))
    print(table(("kind", "labelled", "found", "precision", "recall"), rows))
    print(f"{sum(pairs.values())} labelled parts, {sum(pairs.values()) - true} of them no fasteners")
    figures["all"] = {"labelled": true, "found": said, "right": right}
    write_json(
        options.json,
        {
            "machine": machine(),
            "parts": sum(pairs.values()),
            "by_kind": figures,
            "precision": {"value": right / said if said else None, "unit": "share", "better": "higher"},
            "recall": {"value": right / true if true else None, "unit": "share", "better": "higher"},
        },
    )


def share(part: int, whole: int) -> str:
    """Return a share in per cent, or a dash where there is nothing to share."""
    return f"{100.0 * part / whole:.1f} %" if whole else "-"


if __name__ == "__main__":
    main()
