"""Training speed: states a second of each model, and the share of the time that is not spent in the network.

    python benchmarks/training.py CONFIG... --cache DIR [--seconds 20] [--device cuda:0] [--blueprints 64] [--threads 2]

Each model is trained alone, from nothing, for so many seconds. The speed is the median over lines of the log, the
first left out; the share is of steps that are timed apart, with the device waited for before and after.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from common import REPOSITORY, machine, table, write_json

from sashimono import d4pas
from sashimono.learning.cloud_cache import make_cache
from sashimono.learning.config_files import read_config
from sashimono.learning.devices import find_place
from sashimono.learning.registry import prepared
from sashimono.learning.train import Row, train


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configs", nargs="+")
    parser.add_argument("--cache", type=Path, required=True, help="folder for the clouds, as of 'sashimono train'")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each model")
    parser.add_argument("--device", default=None)
    parser.add_argument("--blueprints", type=int, default=None, help="a batch, instead of the configuration's")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--workers", type=int, default=1, help="processes that make the clouds")
    parser.add_argument("--json", type=Path, default=REPOSITORY / "benchmarks" / "results" / "training.json")
    options = parser.parse_args()
    import torch

    if options.threads is not None:
        torch.set_num_threads(options.threads)
    data = d4pas.load("v1")
    configs = [read_config(name, log_every=10, checkpoint_seconds=1e9) for name in options.configs]
    cache = make_cache(data, options.cache, workers=options.workers)
    cache = prepared(cache, data, [config.kind for config in configs], workers=options.workers)
    rows: dict[str, dict[str, float | int]] = {}
    with find_place(options.device) as place:
        on_gpu = place.device.startswith("cuda")
        device = torch.cuda.get_device_name(place.device) if on_gpu else f"cpu, {torch.get_num_threads()} threads"
        clouds = cache.to(place.device, extras={name for config in configs for name in config.batch.extras})
        for config in configs:
            if options.blueprints is not None:
                config = replace(config, batch=replace(config.batch, blueprints=options.blueprints))
            lines: list[Row] = []
            spent = time.process_time()
            with TemporaryDirectory() as folder:
                done = train(
                    config, cache, Path(folder), place=place, minutes=options.seconds / 60, clouds=clouds,
                    report=lines.append,
                )  # fmt: skip
            settled = lines[1:] or lines
            rows[config.name] = {
                "blueprints": config.batch.blueprints,
                "states_per_second": round(statistics.median(line["states_per_second"] for line in settled), 1),
                "outside": round(done.outside, 4),
                "steps": done.steps,
                "processor_share": round((time.process_time() - spent) / (60 * done.minutes), 2),
            }
    head = ("model", "blueprints a batch", "states a second", "outside the network", "steps")
    print(device)
    print(
        table(
            head,
            [
                (name, r["blueprints"], r["states_per_second"], f"{r['outside']:.1%}", r["steps"])
                for name, r in rows.items()
            ],
        )
    )
    write_json(options.json, {"machine": machine(), "device": device, "torch": torch.__version__, "models": rows})


if __name__ == "__main__":
    main()
