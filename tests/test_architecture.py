"""The tree is held to its own rules: import directions, light imports, public names, nothing of this machine."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import sashimono

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "src" / "sashimono"
MODULES = sorted(PACKAGE.rglob("*.py"))

LEVELS = [
    {"errors", "files", "reporting"},
    {"selection", "raster"},
    {"geometry"},
    {"assembly", "plan", "bodies"},
    {"io"},
    {"stability", "fasteners", "bearings"},
    {"examination"},
    {"disassembly"},
    {"fits", "motion"},
    {"contact"},
    {"tree", "bought", "caged"},
    {"verify", "view"},
    {"d4pas", "revision"},
    {"learning"},
    {"pipeline", "replanning"},
    {"outputs", "console"},
    {"tasks", "exports"},
    {"notebook"},
    {"commands"},
    {"cli_common"},
    {"serve"},
    {"cli_dataset", "cli_learning", "cli_serve"},
    {"cli"},
    {"serve_child"},
]
"""Lowest first; a unit is a module or package right below `sashimono`."""

ROOMS = {
    "geometry": [{"se3"}, {"mesh", "legs"}, {"distance"}, {"body"}, {"overlap"}, {"features"}],
    "io": [
        {"raw", "names"},
        {"mending"},
        {"formats"},
        {"plan_schema"},
        {"checks", "plan_json", "resting_file", "constraints_file", "tree"},
        {"kept"},
        {"read"},
        {"plan_input"},
    ],
    "revision": [{"sources"}, {"parts"}, {"steps", "carry_over"}, {"compare"}, {"report"}],
    "examination": [{"config"}, {"findings"}, {"size", "pairs", "hidden"}, {"examine"}, {"report"}],
    "serve": [{"limits"}, {"upload", "options", "jobs"}, {"workers"}, {"web"}, {"server"}],
    "fasteners": [
        {"sizes", "profile"},
        {"shape", "placement"},
        {"recognise"},
        {"precedence", "bonds", "tools"},
        {"report"},
    ],
    "fits": [{"config"}, {"shapes", "arms", "pressing", "piercing"}, {"find"}],
    "disassembly": [
        {"masks", "removal", "refusal", "tolerances"},
        {"separation", "placed_parts"},
        {"straying"},
        {"free_travel"},
        {"paths", "shared_bodies"},
        {"blocking"},
        {"translation", "threads", "physics", "tilting"},
        {"config", "inquiry"},
        {"conditions"},
        {"cascade"},
        {"sequence"},
        {"explanation"},
    ],
}
"""Lowest first; a room is a module or sub-package of a package. Those of one set do not import each other."""

ALGORITHMS = {
    "geometry",
    "stability",
    "fasteners",
    "disassembly",
    "fits",
    "motion",
    "contact",
    "tree",
    "bought",
    "bearings",
    "caged",
}
"""Packages that compute; files are read and written above them."""

SAME_LEVEL = {("plan", "assembly"), ("bodies", "assembly")}
"""The only imports within a level."""

DISTRIBUTIONS = {
    "PIL": "pillow",
    "fcl": "python-fcl",
    "igl": "libigl",
    "stable_baselines3": "stable-baselines3",
    "warp": "warp-lang",
}
"""Distributions whose import name differs."""


def module_of(path: Path) -> str:
    """Return the dotted name of a module without the package."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def unit_of(path: Path) -> str:
    """Return the unit a file belongs to; the empty string for the package's own ``__init__``."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def imported(path: Path) -> Iterator[tuple[str, bool]]:
    """Yield every imported module's dotted name, wherever the statement stands, and whether it is at module level.

    ``from sashimono.geometry import se3`` yields ``sashimono.geometry.se3``.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    top = {id(node) for node in tree.body}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, id(node) in top
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            for alias in node.names:
                yield f"{node.module}.{alias.name}", id(node) in top


def in_package(path: Path) -> Iterator[tuple[str, str]]:
    """Yield (unit, dotted name without the package) of every import from within the package."""
    for name, _ in imported(path):
        head, *rest = name.split(".")
        if head == "sashimono" and rest and rest[0] != "__version__":
            yield rest[0], ".".join(rest)


def of_an_extra() -> set[str]:
    """Return the modules that need an extra: Warp's kernels, and what of learning imports PyTorch or Gymnasium."""
    found = {"sashimono.disassembly.physics.batch_kernels"}
    while True:
        needed = {"torch", "gymnasium", "stable_baselines3", "matplotlib", *found}
        more = {
            f"sashimono.{module_of(path)}"
            for path in MODULES
            if unit_of(path) == "learning"
            and any(
                at_module_level and any(f"{name}.".startswith(f"{module}.") for module in needed)
                for name, at_module_level in imported(path)
            )
        }
        if more <= found:
            return found
        found |= more


OF_AN_EXTRA = of_an_extra()
"""Modules that are imported only where their extra is asked for, and by each other."""

BASE_LEARNING = {"cloud_cache", "commands", "evaluate", "infer", "registry", "report"}
"""Modules of learning that run in the base install."""


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_downward(path: Path) -> None:
    unit = unit_of(path)
    if unit in ("", "__main__"):
        return
    rank = {name: k for k, names in enumerate(LEVELS) for name in names}
    assert unit in rank, f"{unit} has no level: add it to LEVELS"
    upward = [
        name
        for other, name in in_package(path)
        if other != unit and rank[other] >= rank[unit] and (unit, other) not in SAME_LEVEL
    ]
    assert upward == []


@pytest.mark.parametrize("package", ROOMS)
def test_imports_between_rooms_point_downward(package: str) -> None:
    rank = {name: k for k, names in enumerate(ROOMS[package]) for name in names}
    upward = []
    for path in sorted((PACKAGE / package).rglob("*.py")):
        room = path.relative_to(PACKAGE / package).with_suffix("").parts[0]
        if room == "__init__":
            continue
        assert room in rank, f"{room} has no place: add it to ROOMS"
        for unit, name in in_package(path):
            if unit != package:
                continue
            other = name.split(".")[1]
            assert other in rank, f"{path}: {name} is no room"
            if other != room and rank[other] >= rank[room]:
                upward.append(f"{module_of(path)} -> {name}")
    assert upward == []


def test_no_two_files_of_the_algorithms_import_each_other_in_a_circle() -> None:
    names = {module_of(path) for path in MODULES}
    graph = {
        module_of(path): {name if name in names else name.rpartition(".")[0] for _, name in in_package(path)}
        for path in MODULES
        if unit_of(path) in ALGORITHMS
    }
    assert graph
    list(TopologicalSorter(graph).static_order())


def test_algorithms_read_and_write_no_files() -> None:
    found = {
        f"{module_of(path)} -> {name}"
        for path in MODULES
        if unit_of(path) in ALGORITHMS
        for unit, name in in_package(path)
        if unit == "io"
    }
    assert found == set()


def test_verify_shares_no_code_with_the_planner() -> None:
    allowed = re.compile(r"(errors|assembly|plan|io|verify)(\.|$)|geometry\.se3(\.|$)")
    used = {name for path in (PACKAGE / "verify").rglob("*.py") for _, name in in_package(path)}
    assert used
    assert sorted(name for name in used if not allowed.match(name)) == []


def test_modules_of_an_extra_are_imported_only_where_it_is_asked_for() -> None:
    light = [path for path in MODULES if f"sashimono.{module_of(path)}" not in OF_AN_EXTRA]
    early = [name for path in light for name, at_module_level in imported(path) if at_module_level]
    assert [name for name in early if any(f"{name}.".startswith(f"{module}.") for module in OF_AN_EXTRA)] == []


def test_learning_that_runs_in_the_base_install_needs_no_torch() -> None:
    assert {f"sashimono.learning.{name}" for name in BASE_LEARNING} & OF_AN_EXTRA == set()
    assert "sashimono.learning.past" in OF_AN_EXTRA


def test_third_party_imports_are_declared() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]

    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[<>=!~;\[ ]", text, maxsplit=1)[0] for text in requirements}

    required = names(project["dependencies"])
    optional = names([text for group in project["optional-dependencies"].values() for text in group])
    used = set()
    for path in MODULES:
        for name, at_module_level in imported(path):
            head = name.split(".")[0]
            if head in sys.stdlib_module_names or head == "sashimono":
                continue
            distribution = DISTRIBUTIONS.get(head, head)
            used.add(distribution)
            needed = at_module_level and f"sashimono.{module_of(path)}" not in OF_AN_EXTRA
            declared = required if needed else required | optional
            assert distribution in declared, f"{path}: {head} is not declared in pyproject.toml"
    assert required - used == set(), "declared, but imported nowhere"


@pytest.mark.parametrize(
    "statement",
    [
        "import sashimono",
        "from sashimono.cli import run; run(['--help'])",
        "from sashimono.cli import run; run(['plan'])",
    ],
)
def test_nothing_heavy_is_imported_early(statement: str) -> None:
    heavy = ["numpy", "scipy", "numba", "trimesh", "igl", "fcl", "manifold3d", "cascadio", "torch", "ray", "rich"]
    code = f"{statement}; import sys; print('imported:', [m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("imported: []\n")


def test_public_names_resolve_and_are_listed_once() -> None:
    assert len(set(sashimono.__all__)) == len(sashimono.__all__)
    assert sorted(sashimono.__all__) == dir(sashimono)
    for name in sashimono.__all__:
        assert getattr(sashimono, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'absent'"):
        _ = sashimono.absent


def test_each_package_has_the_names_it_lists() -> None:
    homes: dict[int, str] = {}
    for info in pkgutil.iter_modules(sashimono.__path__, "sashimono."):
        if not info.ispkg:
            continue
        package = importlib.import_module(info.name)
        listed = getattr(package, "__all__", [])
        assert len(set(listed)) == len(listed)
        for name in listed:
            value = getattr(package, name)
            assert homes.setdefault(id(value), info.name) == info.name, f"{name} is public in two packages"


def repository_files() -> list[Path]:
    """Return the project's own text files, however the tree was obtained."""
    folders = ["src", "tests", "docs", "examples", "benchmarks", ".ci"]
    found = [path for folder in folders for path in (REPOSITORY / folder).rglob("*")]
    found += [path for path in REPOSITORY.iterdir() if path.name != ".git"]
    binary = {".png", ".webp", ".gif", ".pyc", ".nbi", ".nbc", ".glb", ".parquet", ".onnx", ".pt"}
    return [path for path in found if path.is_file() and path.suffix not in binary]


def test_nothing_of_one_machine_is_in_the_repository() -> None:
    # spelled in pieces, so that this file does not hold them itself
    private = re.compile(
        "|".join(re.escape("/" + name) for name in ("work/", "root/", "tmp/w/", "opt/pypi", "opt/wheels"))
    )
    files = repository_files()
    assert len(files) > 20
    found = [path for path in files if private.search(path.read_text(encoding="utf-8", errors="replace"))]
    assert found == []


def test_constraints_name_versions_only() -> None:
    lines = (REPOSITORY / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[a-z0-9-]+==[0-9][0-9a-z.]*", pin) for pin in pins)
    assert "torch==2.13.0" in pins
