"""Reading a STEP file (ISO 10303-21) through OpenCASCADE's converter to glTF."""

from __future__ import annotations

import logging
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from sashimono.errors import InputError
from sashimono.io.formats import step_to_glb
from sashimono.io.formats.gltf import Leaf, read_gltf
from sashimono.io.formats.scenes import number_shapes, place
from sashimono.io.mending.mend import closes
from sashimono.io.names import choose_name, says_nothing
from sashimono.io.raw import Occurrence, RawAssembly, ReadConfig, refuse_many

_log = logging.getLogger(__name__)

_PREFIXES = {b"": "m", b"MILLI": "mm", b"CENTI": "cm", b"DECI": "dm", b"MICRO": "um"}
_CONVERTED = {b"INCH": "in", b"IN": "in", b"FOOT": "ft", b"FEET": "ft", b"FT": "ft"}


def read_step(path: Path, data: bytes, config: ReadConfig) -> RawAssembly:
    """Return the parts of a STEP file: one for each leaf of the product tree, named by its product.

    Raises InputError if the file is no STEP file, is broken, or holds no surfaces.
    """
    if b"ISO-10303-21" not in data[:4096]:
        raise InputError(f"{path}: not a STEP file (no ISO-10303-21 header); export it as STEP AP214 or AP242")
    # each is one placement of a product in another; nested ones multiply, so that this is the least there can be
    refuse_many(data.count(b"NEXT_ASSEMBLY_USAGE_OCCURRENCE"), str(path), config.max_parts)
    glb, said = _convert(data, config, 1.0)
    if not glb:
        raise InputError(f"{path}: the STEP file is broken or cut short ({_reason(said)}); export it again")
    leaves, _ = read_gltf(glb, None, str(path), most=config.max_parts)
    leaves, retried = _retry_open(leaves, data, path, config)
    shapes = number_shapes([leaf.shape for leaf in leaves])
    products = _product_names(data)
    parts = [
        place(
            name=choose_name((leaf.mesh, leaf.node, *leaf.ancestors)), where=str(path), T=leaf.T_world_node,
            vertices=leaf.vertices, faces=leaf.faces, color=leaf.color, shape=shape,
            products=tuple(_named(use, products) for use in reversed(leaf.above)),
        )
        for leaf, shape in zip(leaves, shapes, strict=True)
    ]  # fmt: skip
    skipped = list(dict.fromkeys(re.findall(r"skipped node '(.*?)' without geometry data", said)))
    notes = [f"{name}: no surface in the file; left out" for name in skipped]
    notes += [f"{parts[k].name}: tessellated {factor:g} times as coarse, to close it" for k, factor in retried.items()]
    return RawAssembly(
        parts=tuple(parts), unit=_unit(data), files={path.name: data}, split_single=True,
        notes=tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def _retry_open(leaves: list[Leaf], data: bytes, path: Path, config: ReadConfig) -> tuple[list[Leaf], dict[int, float]]:
    """Return the leaves with open ones tessellated anew, and by which factor, by index.

    The converter leaves out a face that it fails to mesh; at another resolution it often succeeds.
    """
    known: dict[tuple, bool] = {}
    for leaf in leaves:
        if leaf.shape not in known:
            known[leaf.shape] = closes(leaf.vertices, leaf.faces, config)
    still_open = [k for k, leaf in enumerate(leaves) if not known[leaf.shape]]
    leaves, retried = list(leaves), {}
    for factor in config.step_retries if still_open else ():
        glb, _ = _convert(data, config, factor)
        again, _ = read_gltf(glb, None, str(path), most=config.max_parts) if glb else ([], {})
        if [leaf.mesh for leaf in again] != [leaf.mesh for leaf in leaves]:
            continue
        for k in still_open.copy():
            if closes(again[k].vertices, again[k].faces, config):
                leaves[k] = replace(again[k], shape=(factor, *again[k].shape))
                retried[k] = factor
                still_open.remove(k)
        if not still_open:
            break
    return leaves, retried


def _convert(data: bytes, config: ReadConfig, factor: float) -> tuple[bytes, str]:
    """Return the file as GLB (empty if it cannot be read) and what the converter printed.

    Raises RuntimeError if the converter cannot be run at all.
    """
    tolerances = (config.step_linear * factor, config.step_angular * factor)
    with tempfile.TemporaryDirectory(prefix="sashimono-step-") as folder:
        out = Path(folder, "out.glb")
        # -P: the folder of the script is no place to import from
        command = [sys.executable, "-P", step_to_glb.__file__, str(out), *map(repr, tolerances)]
        done = subprocess.run(command, input=data, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        said = re.sub(r"\x1b\[[\d;]*m", "", done.stdout.decode("utf-8", "replace")).strip()
        if done.returncode > 0:
            raise RuntimeError(f"the STEP converter cannot be run: {said}")
        if done.returncode < 0:
            said = f"{said}\nError: OpenCASCADE crashed on it (signal {-done.returncode})".strip()
        glb = out.read_bytes() if done.returncode == 0 else b""
    if said:
        _log.debug("OpenCASCADE: %s", said)
    return glb, said


_TEXT = rb"'((?:[^']|'')*)'"
_USE = re.compile(rb"=\s*NEXT_ASSEMBLY_USAGE_OCCURRENCE\s*\(\s*%b\s*,\s*%b[^;]*?#\d+\s*,\s*#(\d+)" % (_TEXT, _TEXT))
_DEFINITION = re.compile(rb"#(\d+)\s*=\s*PRODUCT_DEFINITION\w*\s*\(\s*%b\s*,[^;]*?#(\d+)" % _TEXT)
_PRODUCT = re.compile(rb"#(\d+)\s*=\s*PRODUCT\s*\(\s*%b\s*,\s*%b" % (_TEXT, _TEXT))


def _product_names(data: bytes) -> dict[str, str]:
    """Return the names of the products by what the file calls their uses, where a use has but one product.

    The converter names a nested product by its use, which many programs only number ("NAUO6").
    """
    definitions = {number: above for number, _, above in _DEFINITION.findall(data)}
    names = {number: second.strip() or first for number, first, second in _PRODUCT.findall(data)}
    found: dict[bytes, set[bytes]] = {}
    for first, second, definition in _USE.findall(data):
        name = names.get(definitions.get(definitions.get(definition, b""), b""), b"")
        for use in {first, second}:
            found.setdefault(use.strip(), set()).add(name)
    return {
        use.decode("latin-1"): only.decode("latin-1").replace("''", "'")
        for use, (only, *more) in ((use, sorted(products)) for use, products in found.items())
        if not more
    }


def _named(use: Occurrence, products: dict[str, str]) -> Occurrence:
    """Return the use of a product, called like the product where its own name says nothing."""
    return replace(use, name=products.get(use.name, use.name)) if says_nothing(use.name) else use


def _reason(said: str) -> str:
    """Return the converter's first complaint as one line."""
    lines = [line.strip(" *") for line in said.splitlines() if "ERR" in line or line.startswith("Error")]
    return (lines or ["no reason given"])[0]


def _unit(data: bytes) -> str:
    """Return the name of the file's length unit; "mm" if it names none, as OpenCASCADE assumes."""
    for record in re.findall(rb"=\s*\(([^;]*LENGTH_UNIT[^;]*)\)\s*;", data):
        converted = re.search(rb"CONVERSION_BASED_UNIT\s*\(\s*'\s*(\w+)", record)
        if converted and converted.group(1).upper() in _CONVERTED:
            return _CONVERTED[converted.group(1).upper()]
    si = re.search(rb"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)", data)
    return _PREFIXES.get((si.group(1) or b"").upper(), "mm") if si else "mm"
