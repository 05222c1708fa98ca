"""Shapes of generated hardware, with known answers; and what looks like it and is none."""

from __future__ import annotations

import numpy as np
import pytest
from hardware import MM, circlip, cylinder, hexagon, nut, plate, ring, screw, standoff, threaded
from scipy.spatial.transform import Rotation
from solids import Manifold, box, part

from sashimono.fasteners.shape import Shape, ShapeConfig, recognise_shape
from sashimono.fasteners.sizes import nominal_width, nut_size, shank_size, washer_size


def shape_of(solid: Manifold, *, turned: bool = True) -> Shape | None:
    """The shape of a solid, turned and moved so that nothing is along a world axis."""
    p = part("p", solid)
    vertices = p.vertices_part
    if turned:
        vertices = vertices @ Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix().T + np.array([0.05, -0.02, 0.01])
    return recognise_shape(vertices, p.faces, config=ShapeConfig())


@pytest.mark.parametrize("segments", [10, 16, 48, 96])
@pytest.mark.parametrize("drive", ["hex", "hex socket", "slot", "cross"])
def test_screws_are_told_by_head_and_drive_for_coarse_and_fine_facets(drive: str, segments: int) -> None:
    found = shape_of(screw(6 * MM, 20 * MM, drive, segments=segments))
    assert found is not None
    assert (found.form, found.drive, found.certain, found.size) == ("headed", drive, True, "M6")
    way_in = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix() @ np.array([0.0, 0.0, -1.0])
    assert found.axis @ way_in > 0.9999
    assert found.length == pytest.approx(20 * MM, rel=0.05)
    if drive.startswith("hex"):
        assert found.drive_size == pytest.approx({"hex": 9.9 * MM, "hex socket": 4.8 * MM}[drive], rel=0.02)


def test_a_countersunk_head_with_a_slot_is_a_screw() -> None:
    found = shape_of(screw(5 * MM, 20 * MM, "countersunk"))
    assert found is not None
    assert (found.form, found.drive) == ("headed", "slot")


def test_a_head_without_drive_is_left_to_where_it_sits() -> None:
    found = shape_of(screw(6 * MM, 20 * MM, "none"))
    assert found is not None
    assert (found.form, found.drive, found.certain) == ("headed", "none", False)


def test_a_thread_is_found_and_makes_the_head_certain() -> None:
    found = shape_of(threaded(6 * MM, 12 * MM, 1 * MM) + cylinder(10 * MM, 4 * MM))
    assert found is not None
    assert found.form == "headed"
    assert found.certain
    assert found.helix is not None
    assert 2 * np.pi * abs(found.helix.pitch) == pytest.approx(1 * MM, rel=0.15)  # its facets are coarse


def test_a_nut_with_and_without_thread() -> None:
    plain = shape_of(nut(6 * MM, 10 * MM, 5 * MM))
    assert plain is not None
    assert (plain.form, plain.size, plain.certain, plain.helix) == ("nut", "M6", True, None)
    assert plain.drive_size == pytest.approx(10 * MM, rel=0.02)
    wound = shape_of(ring(0.1 * MM, 12 * MM, 6 * MM) - threaded(8 * MM, 12 * MM, 1.25 * MM).translate((0, 0, 9 * MM)))
    assert wound is not None
    assert wound.form == "nut"
    assert wound.helix is not None


def test_washers_standoffs_and_circlips() -> None:
    washer = shape_of(ring(6.4 * MM, 12 * MM, 1.6 * MM))
    assert washer is not None
    assert (washer.form, washer.size, washer.certain) == ("washer", "M6", True)
    odd = shape_of(ring(7.7 * MM, 12 * MM, 2.6 * MM))
    assert odd is not None
    assert (odd.form, odd.certain) == ("washer", False)
    bar = shape_of(standoff(7 * MM, 20 * MM, 3.3 * MM, 8 * MM))
    assert bar is not None
    assert (bar.form, bar.size) == ("standoff", "M4")
    clip = shape_of(circlip(9.3 * MM, 12.5 * MM, 1 * MM))
    assert clip is not None
    assert clip.form == "circlip"


def test_a_set_screw_and_a_plain_bar() -> None:
    found = shape_of(cylinder(4 * MM, 8 * MM) - hexagon(2 * MM, 5 * MM, 5.5 * MM))
    assert found is not None
    assert (found.form, found.drive, found.size) == ("headless", "hex socket", "M4")
    bar = shape_of(cylinder(5 * MM, 30 * MM))
    assert bar is not None
    assert (bar.form, bar.certain) == ("headless", False)


@pytest.mark.parametrize(
    "solid",
    [
        ring(8 * MM, 12 * MM, 20 * MM),
        ring(20 * MM, 22 * MM, 8 * MM),
        cylinder(8 * MM, 40 * MM) + cylinder(30 * MM, 8 * MM, 40 * MM),
        cylinder(8 * MM, 40 * MM) + cylinder(12 * MM, 5 * MM, 20 * MM),
        cylinder(20 * MM, 12 * MM) - hexagon(9 * MM, 1.0, -0.5),
        hexagon(9 * MM, 50 * MM),
        box((20 * MM, 12 * MM, 5 * MM)),
        plate(5 * MM, 6 * MM, 0.0),
    ],
    ids=["spacer", "thin ring", "knob", "shaft with collar", "wheel on a hex shaft", "hex bar", "block", "plate"],
)
def test_look_alikes_are_none(solid: Manifold) -> None:
    assert shape_of(solid) is None


def test_a_knob_with_six_lobes_has_no_hexagon_head() -> None:
    lobes = cylinder(24 * MM, 12 * MM)
    for k in range(6):
        angle = np.pi * k / 3
        lobes -= cylinder(9 * MM, 40 * MM, -1 * MM).translate((13 * MM * np.cos(angle), 13 * MM * np.sin(angle), 0.0))
    found = shape_of(lobes + cylinder(9 * MM, 20 * MM, -20 * MM))
    assert found is None or not found.certain


def test_an_open_surface_is_none() -> None:
    p = part("p", screw(6 * MM, 20 * MM, "hex"))
    assert recognise_shape(p.vertices_part, p.faces[1:], config=ShapeConfig()) is None


def test_sizes() -> None:
    assert [shank_size(d * MM) for d in (3.0, 2.9, 5.9, 7.0, 8.0, 400.0)] == ["M3", "M3", "M6", "", "M8", ""]
    assert nut_size(5.0 * MM, 10.0 * MM) == "M6"
    assert nut_size(9.0 * MM, 10.0 * MM) == ""
    assert washer_size(5.3 * MM, 10.0 * MM, 1.0 * MM) == "M5"
    assert nominal_width(4.05 * MM, key=True) == 4.0
    assert nominal_width(9.52 * MM, key=False) == 9.5
