"""Draw a contact sheet of D4PAS: a whole product of each family, coloured and numbered by assembly order.

pip install 'sashimono[dataset,render]'
python examples/d4pas_contact_sheet.py [DATASET] [--out sheet.webp]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from sashimono.d4pas import Blueprint, load
from sashimono.d4pas.recipe import ONLY
from sashimono.d4pas.sheets import contact_sheet, entry_of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", nargs="?", default="v1")
    parser.add_argument("--out", type=Path, default=Path("d4pas.webp"))
    options = parser.parse_args()
    data = load(options.dataset)
    largest: dict[str, Blueprint] = {}
    for blueprint in data:
        if ONLY not in blueprint.params and len(blueprint) <= 16:  # larger ones are hard to read in a small picture
            known = largest.get(blueprint.family)
            if known is None or len(blueprint) > len(known):
                largest[blueprint.family] = blueprint
    entries = [entry_of(largest[family], data.steps[largest[family].id]) for family in sorted(largest)]
    contact_sheet(entries, options.out)


if __name__ == "__main__":
    main()
