"""Recipes and families: valid by construction, the same on every machine, refused where they cannot be made."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sashimono.d4pas import kit
from sashimono.d4pas.families import families
from sashimono.d4pas.fits import FITS, clearance
from sashimono.d4pas.product import Product
from sashimono.d4pas.recipe import (
    Recipe,
    build_assembly,
    build_product,
    content_hash,
    draw_recipe,
    find_faults,
)
from sashimono.d4pas.recipe_book import read_book
from sashimono.errors import InputError

HASHES = Path(__file__).parent / "d4pas_hashes.json"
"""Content hashes of the first member of each family; renewed on purpose only: the family's version goes up with it."""


@pytest.mark.parametrize("family", families())
def test_members_are_valid_and_made_again_from_json(family: str) -> None:
    for seed in (0, 7, 31):
        recipe = draw_recipe(family, seed)
        product = build_product(recipe)
        assert find_faults(product) == []
        assert len(product.solids) >= 3
        again = Recipe(
            family=family, version=recipe.version, params=json.loads(json.dumps(recipe.params)), seed=recipe.seed
        )
        assert content_hash(build_assembly(again)) == content_hash(build_assembly(recipe))


@pytest.mark.parametrize("family", families())
def test_the_geometry_of_a_recipe_is_the_one_it_always_was(family: str) -> None:
    known = json.loads(HASHES.read_text(encoding="utf-8"))
    recipe = draw_recipe(family, 0)
    assert known[family]["version"] == recipe.version
    assert content_hash(build_assembly(recipe)) == known[family]["hash"]


def test_there_are_at_least_24_families_named_as_their_modules() -> None:
    assert len(families()) >= 24
    for name, family in families().items():
        assert family.draw.__module__ == f"sashimono.d4pas.families.{name}"
        assert family.name == name
        assert family.summary


def test_a_pair_is_two_parts_that_touch() -> None:
    recipe = draw_recipe("bolted_plates", 3, pair=True)
    assert len(build_assembly(recipe)) == 2
    assert find_faults(build_product(recipe)) == []
    assert recipe.id == "bolted_plates-000003-pair"


def test_faults_are_named() -> None:
    product = Product()
    product.add("block", kit.box((0, 0, 0), (1, 1, 1)))
    product.add("block", kit.box((0.5, 0, 0), (2, 1, 1)))
    product.add("far", kit.box((9, 0, 0), (10, 1, 1)))
    product.add("halves", kit.box((9, 2, 0), (10, 3, 1)) + kit.box((9, 5, 0), (10, 6, 1)))
    assert find_faults(product) == ["halves is in 2 pieces"]
    del product.solids["halves"]
    overlap, apart = find_faults(product)
    assert "block_2 overlap by 0.5 mm³" in overlap
    assert "2 groups of parts do not touch" in apart
    product.declare_fit("block", "block_2")
    assert len(find_faults(product)) == 1


def test_a_recipe_of_another_version_is_refused() -> None:
    recipe = draw_recipe("bolted_plates", 0)
    other = Recipe(family=recipe.family, version=recipe.version + 1, params=recipe.params, seed=0)
    with pytest.raises(InputError, match="asks for version"):
        build_product(other)
    with pytest.raises(InputError, match="family 'gearshift' is not known; choose from"):
        draw_recipe("gearshift", 0)


def test_fits_go_from_loose_to_press() -> None:
    for diameter in (2.0, 8.0, 25.0, 100.0, 400.0):
        gaps = [clearance(diameter, fit) for fit in FITS]
        assert gaps == sorted(gaps, reverse=True)
        assert gaps[-1] < 0.0 < gaps[0]
    assert clearance(8.0, "exact") == 0.0
    assert clearance(20.0, "H7/g6") == pytest.approx(0.024)


def test_placing_keeps_axes_exact() -> None:
    rod = kit.cylinder(2.0, 0.0, 5.0)
    for axis in ((1, 0, 0), (0, -1, 0), (0, 0, -1)):
        low = np.array(kit.place(rod, (0.0, 0.0, 0.0), axis).bounding_box()).reshape(2, 3)
        along = int(np.argmax(np.abs(axis)))
        assert set(np.abs(low[:, along]).tolist()) == {0.0, 5.0}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[families]\nnothing = 3", "family 'nothing' is not known"),
        ("[families]\nbolted_plates = -1", "should be a whole number of 0 or more"),
        ("[families]\nbolted_plates = 1\n[split]\nteste = 3", "teste is not known"),
        ('[families]\nbolted_plates = 1\n[split]\ntest = "many"', "test = 'many' should be a whole number"),
        ("[families]\nbolted_plates = 1\n[split]\nunseen = 3", "should be a list of families"),
        ("[families]\nbolted_plates = 1\n[split]\nnear = nan", "near = nan should be a number from 0 to 1"),
        ("max_sequences = 0\n[families]\nbolted_plates = 1", "max_sequences = 0 should be a whole number of 1"),
        ("max_steps = 0.5\n[families]\nbolted_plates = 1", "max_steps = 0.5 should be a whole number"),
        ("first_seed = 99999999999999999999\n[families]\nbolted_plates = 1", "should be a whole number"),
        ("turned = 2\n[families]\nbolted_plates = 1", "turned = 2 should be a number from 0 to 1"),
        ("[familes]\nbolted_plates = 1", "familes is not known"),
        ("name = 3\n", "is missing or no table|names no family"),
        ("[families", "not readable TOML"),
    ],
)
def test_a_bad_recipe_book_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "book.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_book(str(path))
    assert "\n" not in str(caught.value)


def test_shipped_books_name_the_families() -> None:
    assert set(read_book("tiny").counts) == set(families())
    assert len(set(read_book("v1").counts)) >= 24
