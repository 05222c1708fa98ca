"""``sashimono train | evaluate | infer``: PAST, its baselines and ours from the command line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from sashimono.cli_common import command, make_app
from sashimono.commands import OK, reading_options
from sashimono.errors import SashimonoError
from sashimono.outputs import refuse_bad_files, refuse_unwritable, replacing_together
from sashimono.reporting import say

learning_app = make_app()

Data = Annotated[str, typer.Option("--data", metavar="DATASET", help="a dataset's folder, or v1: the shipped one")]
Device = Annotated[str | None, typer.Option(metavar="NAME", help="cpu, cuda, cuda:0; a GPU if there is one")]
Cache = Annotated[Path | None, typer.Option(metavar="DIR", help="folder for the sampled clouds; --out if not given")]
Workers = Annotated[int, typer.Option(min=1, metavar="N", help="processes that sample clouds")]


@command(learning_app)
def train(
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", metavar="DIR", help="folder for checkpoint, log and weights; gone on from if it has any"
        ),
    ],
    config: Annotated[
        str | None, typer.Argument(metavar="CONFIG", help="a shipped configuration, or a .toml file")
    ] = None,
    campaign: Annotated[
        str | None, typer.Option(metavar="NAME", help="train a campaign's models instead, shipped or .toml")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.0, metavar="N", help="train that long, whatever the steps")
    ] = None,
    processor_time: Annotated[
        bool, typer.Option("--processor-time", help="count --minutes by processor time, not by the clock")
    ] = False,
    steps: Annotated[int | None, typer.Option(min=1, metavar="N", help="steps, instead of the configuration's")] = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="seed, instead of the configuration's")] = None,
    data: Data = "v1",
    start: Annotated[
        Path | None, typer.Option("--from", metavar="PATH", help="weights (a campaign: their folder) to begin with")
    ] = None,
    cache: Cache = None,
    work: Annotated[
        Path | None, typer.Option(metavar="DIR", help="a campaign's folder for clouds and checkpoints")
    ] = None,
    device: Device = None,
    workers: Workers = 1,
) -> int:
    """Train a network on a dataset; run the same command again to go on."""
    from sashimono.learning.commands import campaign_command, train_command

    if (config is None) == (campaign is None):
        raise SashimonoError("train takes either CONFIG or --campaign NAME. Give one of them.")
    if processor_time and (campaign is not None or minutes is None):
        raise SashimonoError("--processor-time counts the --minutes of one CONFIG. Give both, or leave it out.")
    refuse_unwritable(out)
    if campaign is not None:
        if minutes is None:
            raise SashimonoError("--campaign needs to know its time. Give --minutes N.")
        return campaign_command(
            campaign, minutes, out, data=data, work=work, start=start, device=device, workers=workers, say=say
        )
    assert config is not None
    return train_command(
        config, out, data=data, steps=steps, minutes=minutes, processor_time=processor_time, seed=seed, start=start,
        cache=cache, device=device, workers=workers, say=say,
    )  # fmt: skip


@command(learning_app)
def evaluate(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for a JSON file a model")],
    models: Annotated[
        list[Path] | None, typer.Argument(metavar="WEIGHTS...", help="weights.npz files of trained models")
    ] = None,
    split: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="a split, test if not given; repeatable")
    ] = None,
    limit: Annotated[int | None, typer.Option(min=1, metavar="N", help="only so many blueprints of each split")] = None,
    ata: Annotated[
        float | None,
        typer.Option(
            min=0.1, metavar="SECONDS", help="also simulate (ATA), at most so much processor time a blueprint"
        ),
    ] = None,
    data: Data = "v1",
    cache: Cache = None,
    device: Device = None,
    workers: Workers = 1,
) -> int:
    """Evaluate trained networks beside what needs no learning; print the paper's table and groups."""
    from sashimono.learning.commands import evaluate_command

    refuse_unwritable(out)
    if not models and ata is None:
        raise SashimonoError("evaluate takes WEIGHTS of trained models, or --ata SECONDS. Give one of them.")
    for path in models or []:
        if not path.is_file():
            raise SashimonoError(f"{path}: no such file. Name the weights.npz that training wrote.")
    return evaluate_command(
        models or [], out, data=data, splits=tuple(split or ["test"]), limit=limit, ata=ata, cache=cache,
        device=device, workers=workers, say=say,
    )  # fmt: skip


@command(learning_app)
def infer(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT", help="what 'plan' takes, or a folder of .ply points in place")
    ],
    json_file: Annotated[Path, typer.Option("--json", metavar="FILE", help="file to write")],
    model: Annotated[
        str, typer.Option(metavar="NAME", help="a shipped network, or a folder that holds one")
    ] = "past-posed",
    unit: Annotated[str | None, typer.Option(metavar="UNIT", help="unit of INPUT where its format has none")] = None,
    split: Annotated[str, typer.Option(help="parts of several solids: auto, all, none")] = "auto",
    seed: Annotated[int, typer.Option(min=0, help="seed of the sampled points")] = 0,
) -> int:
    """Infer an assembly order by the network alone; nothing is checked. 'plan --method past' verifies every step."""
    from sashimono.io.read import read_assembly
    from sashimono.learning.infer import assembly_clouds, load_network, read_scan
    from sashimono.learning.infer import infer as infer_order

    refuse_bad_files({"--json": json_file})
    network = load_network(model)
    if _is_scan(source):
        names, clouds = read_scan(source, network.relations)
    else:
        assembly = read_assembly(source, unit=unit, config=reading_options(split))
        names, clouds = assembly.names, assembly_clouds(assembly, network.relations, seed=seed)
    found = infer_order(names, clouds, network)
    with replacing_together(json_file.parent) as folder:
        (folder / json_file.name).write_text(found.to_json(), encoding="utf-8")
    width = max(map(len, names))
    for number, step in enumerate(found.steps, 1):
        other = step.runner_up
        beside = "" if other is None else f"  before {other} {step.probabilities[other]:.2f}"
        say(f"{number:4d} {step.chosen:<{width}} {step.probabilities[step.chosen]:.2f}{beside}")
    say(f"{found.sequence_milliseconds:.0f} ms; written: {json_file}")
    return OK


def _is_scan(source: Path) -> bool:
    """Whether this is a folder of .ply files of points without faces."""
    try:
        heads = []
        for path in source.iterdir() if source.is_dir() else ():
            if path.suffix.lower() == ".ply" and path.is_file():
                with path.open("rb") as stream:
                    heads.append(stream.read(4096))
    except OSError:  # the reader of products says what is wrong
        return False
    return bool(heads) and not any(re.search(rb"element face [1-9]", head) for head in heads)
