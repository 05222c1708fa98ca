"""Write ``learning_golden.json``: what tiny models with fixed seeds say. Run it when a model is meant to change."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from learning_toy import toy_dataset
from test_learning_models import CLOUDS, GOLDEN, VARIANTS, golden_values

from sashimono.learning.cloud_cache import make_cache


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        clouds = make_cache(toy_dataset(11), Path(folder), config=CLOUDS).to("cpu")
        values = {variant: golden_values(variant, clouds) for variant in VARIANTS}
    GOLDEN.write_text(json.dumps(values, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
