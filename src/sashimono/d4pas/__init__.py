"""D4PAS: a procedural dataset of assemblies with exact labels, after section IV-B of the paper."""

from __future__ import annotations

from sashimono.d4pas.clouds import blueprint_cloud, part_clouds
from sashimono.d4pas.dataset import Blueprint, Dataset, load
from sashimono.d4pas.make import make_dataset
from sashimono.d4pas.recipe import Recipe, build_assembly, draw_recipe

__all__ = [
    "Blueprint",
    "Dataset",
    "Recipe",
    "blueprint_cloud",
    "build_assembly",
    "draw_recipe",
    "load",
    "make_dataset",
    "part_clouds",
]
