"""Do removal conditions depend on how an assembly lies, how large it is, and how its parts are named and ordered?

    python benchmarks/invariance.py [NAME ...] [--variants N]

Each assembly of the truth set is turned, moved, scaled (a tenth to ten times), renamed and reordered at random, N
times (8 by default): every second time within the parts' own frames, else by their poses. Its removal conditions,
read back, must have the same minimal clauses: then every set of remaining parts has the same answer. Any difference
counts, also between two incomplete ones.
"""

from __future__ import annotations

import numpy as np
from common import SHARED, chosen, machine, parser, table, write_json

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.geometry import se3
from sashimono.io.read import read_assembly


def main() -> None:
    arguments = parser(__doc__, "invariance.json")
    arguments.add_argument("--variants", type=int, default=8, help="random variants of each assembly")
    options = arguments.parse_args()
    rows = []
    for folder in chosen(SHARED / "truth", options.names):
        assembly = read_assembly(folder, unit="mm")
        rows.append({"name": folder.name, "parts": len(assembly)} | compare(assembly, options.variants))
        print(table(list(rows[-1])[:-1], [list(rows[-1].values())[:-1]]).splitlines()[-1], flush=True)
    write_json(options.json, {"machine": machine(), "variants": options.variants, "assemblies": rows})
    print("\n" + table(list(rows[0])[:-1], (list(row.values())[:-1] for row in rows)))
    print(
        f"\nparts with other clauses: {sum(row['differing'] for row in rows)} of {sum(row['compared'] for row in rows)}"
    )


def compare(assembly: Assembly, variants: int) -> dict[str, object]:
    """Return how many parts' clauses differ from the original's, over all variants, and which."""
    original = clauses_by_name(assembly, {name: name for name in assembly.names})
    details = []
    for seed in range(variants):
        moved, names = variant(assembly, np.random.default_rng(seed), inside=seed % 2 == 0)
        again = clauses_by_name(moved, names)
        details += [
            {
                "variant": seed,
                "part": name,
                "lost": [sorted(clause) for clause in original[name] - again[name]],
                "new": [sorted(clause) for clause in again[name] - original[name]],
            }
            for name in assembly.names
            if original[name] != again[name]
        ]
    return {"compared": variants * len(assembly), "differing": len(details), "details": details}


def clauses_by_name(assembly: Assembly, names: dict[str, str]) -> dict[str, set[frozenset[str]]]:
    """Return every part's minimal clauses, by the names that this dictionary gives back."""
    conditions = Cascade(assembly, make_bodies(assembly), config=SeparateConfig()).conditions()
    return {
        names[name]: {frozenset(names[assembly.names[k]] for k in bits(clause.blockers)) for clause in clauses}
        for name, clauses in zip(assembly.names, conditions.clauses, strict=True)
    }


def variant(assembly: Assembly, rng: np.random.Generator, *, inside: bool) -> tuple[Assembly, dict[str, str]]:
    """Return the assembly turned, moved, scaled, renamed and reordered, and the old name of each new one.

    ``inside``: the motion is baked into the vertices; else it is in the poses.
    """
    axis = rng.normal(size=3)
    turn = rng.uniform(0.0, np.pi) * axis / np.linalg.norm(axis)
    scale = 10.0 ** rng.uniform(-1.0, 1.0)
    T = se3.exp(np.concatenate([scale * rng.uniform(-0.1, 0.1, 3), turn]))
    parts, names = [], {}
    for new, k in enumerate(rng.permutation(len(assembly))):
        part = assembly.parts[k]
        place = part.T_world_part.copy()
        place[:3, 3] *= scale
        vertices = scale * part.vertices_part
        if inside:
            vertices, place = se3.apply(T @ place, vertices), np.eye(4)
        else:
            place = T @ place
        parts.append(Part(name=f"part {new}", vertices_part=vertices, faces=part.faces, T_world_part=place))
        names[f"part {new}"] = part.name
    return Assembly(parts=tuple(parts)), names


if __name__ == "__main__":
    main()
