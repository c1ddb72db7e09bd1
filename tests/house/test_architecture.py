"""The shape of the package: imports point down, one door for each library, functions of few parameters."""

import ast
import functools
import gc
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import lagcli

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "lagcli"

# Bottom first: a package imports only from packages before it; files of one package import each other in no circle.
ROOMS = tuple(
    "arrays doubles frozen memory progress errors yaml_tree expression model input smoothness equations compiled linear"
    " native contact start pfaffian simulation statics analysis auditing linearization output running formulations"
    " derivation reporting api cli __main__".split()
)

DOORS = {
    "yaml": ("lagcli.yaml_tree",),
    "typer": ("lagcli.cli.",),
    "rich": ("lagcli.cli.terminal.console",),
    "matplotlib": (
        "lagcli.output.figures.figure_page",
        "lagcli.output.figures.chart_figure",
        "lagcli.reporting.loop_figure",
        "lagcli.output.figures.result_figures",
        "lagcli.output.animation.film",
    ),
    "plotille": ("lagcli.output.figures.chart_terminal",),
    "jinja2": ("lagcli.reporting.report_page",),
    "markupsafe": ("lagcli.reporting.report_page",),
    "orjson": ("lagcli.output.tables.cell_text",),
    "pyarrow": ("lagcli.output.tables.parquet_format",),
    "sympy": (
        "lagcli.pfaffian.",
        "lagcli.derivation.",
        "lagcli.statics.algebraic_zeros",
        "lagcli.statics.polynomial_equations",
        "lagcli.statics.univariate",
    ),
    "mpmath": (
        "lagcli.pfaffian.",
        "lagcli.compiled.multiprecision",
        "lagcli.expression.enclosures",
        "lagcli.statics.all_zeros",
    ),
    "casadi": (
        "lagcli.smoothness.",
        "lagcli.equations.",
        "lagcli.compiled.",
        "lagcli.native.lowering",
        "lagcli.native.machine_code",
        "lagcli.native.operations",
        "lagcli.simulation.events.event",
        "lagcli.simulation.native_steps",
        "lagcli.simulation.native_rules",
        "lagcli.linear.metric",
        "lagcli.linear.metric_rows",
        "lagcli.linear.independent_rows",
        "lagcli.start.precise_rows",
        "lagcli.start.projection",
        "lagcli.formulations.maggi",
        "lagcli.formulations.stiff_system",
        "lagcli.formulations.vakonomic_system",
        "lagcli.analysis.displacement_set",
        "lagcli.analysis.internal_forces",
        "lagcli.linearization.floquet",
        "lagcli.linearization.linearized",
        "lagcli.linearization.lowest",
        "lagcli.simulation.scheme.dop853",
        "lagcli.simulation.events.impulse_event",
        "lagcli.simulation.scheme.method",
        "lagcli.simulation.singularity.singularity_step",
        "lagcli.simulation.scheme.step_end",
        "lagcli.simulation.events.watch_functions",
        "lagcli.statics.kink_points",
        "lagcli.statics.static_report",
        "lagcli.statics.rest_equations",
        "lagcli.statics.static_problem",
    ),
    "distributed": ("lagcli.api.sweep_engines",),
    "llvmlite": ("lagcli.native.machine_code",),
    "scipy": (
        "lagcli.api.sweep_points",
        "lagcli.contact.",
        "lagcli.formulations.stiff_ladder",
        "lagcli.linearization.",
        "lagcli.statics.kink_points",
        "lagcli.statics.static_report",
        "lagcli.statics.refine",
    ),
}

PARAMETERS = 6

# What a slip of ours raises, and what is wider. A library's exceptions are caught by their own names, around its call.
SLIPS = {
    "TypeError", "AttributeError", "AssertionError", "LookupError", "KeyError", "IndexError",
    "Exception", "BaseException",
}  # fmt: skip
MOST_CATCHERS = 3
CATCHERS = {
    "lagcli.cli.terminal.exits": "the last resort: it is told as a bug",
    "lagcli.pfaffian.exact.guarded": "what SymPy breaks down with, told from ours by its file",
    "lagcli.pfaffian.exact.time_limit": "handed on from the thread to the caller",
}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def parsed(files: dict[str, Path]) -> dict[str, ast.Module]:
    """The trees of the files, made without the garbage collector: it would take most of the time, and finds nothing,
    also later."""
    gc.disable()
    try:
        return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in files.items()}
    finally:
        gc.freeze()
        gc.enable()


FILES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@functools.cache
def trees() -> dict[str, ast.Module]:
    """The tree of every file, by its module."""
    return parsed(FILES)


@functools.cache
def nodes(name: str) -> list[ast.AST]:
    """All nodes of the tree of a file, which many tests go through."""
    return list(ast.walk(trees()[name]))


@functools.cache
def imported(name: str) -> frozenset[str]:
    """Every module that a file imports anywhere, in functions and for types alone too."""
    return frozenset(_imported(name))


def _imported(name: str) -> Iterator[str]:
    for node in nodes(name):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: a relative import"
            assert node.module is not None
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in FILES or node.module == "lagcli" else node.module


def room(module: str) -> str:
    return module.split(".")[1]


def inside(module: str) -> set[str]:
    """The files of the package that a file imports."""
    names = {name for name in imported(module) if name.startswith("lagcli.")}
    return names - {"lagcli.__version__"}


def test_every_room_has_its_place_in_the_order() -> None:
    assert {room(name) for name in FILES if name != "lagcli"} == set(ROOMS)


@pytest.mark.parametrize("name", [name for name in FILES if name != "lagcli"])
def test_imports_point_down(name: str) -> None:
    here = ROOMS.index(room(name))
    up = [other for other in inside(name) if ROOMS.index(room(other)) > here]
    assert not up


def test_the_files_of_a_room_import_each_other_in_no_circle() -> None:
    graph = {name: inside(name) & FILES.keys() for name in FILES if name != "lagcli"}
    while graph:
        free = [name for name, needs in graph.items() if not needs & graph.keys() - {name}]
        assert free, f"a circle among {sorted(graph)}"
        for name in free:
            del graph[name]


@pytest.mark.parametrize(
    "package", sorted({path.parent.parent.name for path in PACKAGE.glob("*/*/__init__.py")})
)
def test_the_rooms_of_a_package_import_each_other_in_no_circle(package: str) -> None:
    """The files that stand in no room are one more: they use rooms, or are used by them."""

    def place(name: str) -> str:
        return str(FILES[name].parent.relative_to(PACKAGE))

    inner = [
        name for name in FILES if name.startswith(f"lagcli.{package}.") and FILES[name].stem != "__init__"
    ]
    graph: dict[str, set[str]] = {place(name): set() for name in inner}
    for name in inner:
        graph[place(name)] |= {place(other) for other in inside(name) if other in inner} - {place(name)}
    assert len(graph) > 1
    while free := [name for name, needs in graph.items() if not needs & graph.keys()]:
        for name in free:
            del graph[name]
    assert not graph, f"a circle among {sorted(graph)}"


def test_output_knows_neither_analysis_nor_start() -> None:
    """It draws and writes what it is given; a figure of a witness is of `reporting`."""
    used = {room(other) for name in FILES if name.startswith("lagcli.output.") for other in inside(name)}
    assert "model" in used
    assert not used & {"analysis", "start"}


@pytest.mark.parametrize("library", DOORS)
def test_a_library_has_one_door(library: str) -> None:
    doors = DOORS[library]
    users = {name for name in FILES if any(i.split(".")[0] == library for i in imported(name))}
    through = {
        n for n in users if any(n == door or (door[-1] == "." and n.startswith(door)) for door in doors)
    }
    assert users == through
    assert not doors or users, f"{library} is used nowhere"


def test_what_runs_at_import_is_not_loaded_by_name() -> None:
    """Imports are written as imports, where the tests of this file see them; the package's root is lazy, the group of
    commands loads the one that is asked for, and tables the format of a file, of their own room: no arrow is hidden."""
    lazy = {"lagcli", "lagcli.cli.app", "lagcli.output.tables.table_format"}
    for name in FILES:
        used = {node.attr for node in nodes(name) if isinstance(node, ast.Attribute)}
        used |= {node.id for node in nodes(name) if isinstance(node, ast.Name)}
        assert not used & {"__import__"}, name
        assert name in lazy or "import_module" not in used, name


def test_compiled_functions_refuse_arguments_of_another_size() -> None:
    """CasADi's own take a scalar or nothing for a vector."""
    for name in FILES:
        made = {
            node.func.attr
            for node in nodes(name)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        }
        assert "Function" not in made, name


def names_in(node: ast.AST) -> set[str]:
    names = {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
    return names | {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}


def tuples_of_slips() -> set[str]:
    """The names of tuples of exceptions that hold one of `SLIPS`, whatever module they are in."""
    assigned = [
        node
        for name in FILES
        for node in nodes(name)
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and isinstance(node.value, ast.Tuple)
    ]
    wide = [node for node in assigned if node.value is not None and names_in(node.value) & SLIPS]
    targets = [t for node in wide for t in (node.targets if isinstance(node, ast.Assign) else [node.target])]
    return {target.id for target in targets if isinstance(target, ast.Name)}


def test_slips_of_ours_are_caught_in_a_few_places_alone() -> None:
    wide, found = SLIPS | tuples_of_slips(), []
    for name in FILES:
        for node in nodes(name):
            if isinstance(node, ast.ExceptHandler) and (node.type is None or names_in(node.type) & wide):
                found.append(name)
            if isinstance(node, ast.Call) and "suppress" in names_in(node.func):
                found += [name for argument in node.args if names_in(argument) & wide]
    assert sorted(found) == sorted(CATCHERS)
    assert len(found) <= MOST_CATCHERS


def test_no_text_is_executed() -> None:
    for name in FILES:
        calls = [node.func for node in nodes(name) if isinstance(node, ast.Call)]
        called = {func.id for func in calls if isinstance(func, ast.Name)}
        called |= {func.attr for func in calls if isinstance(func, ast.Attribute)}
        # "compile" alone is the name of a room.
        assert not called & {
            "eval",
            "exec",
            "parse_expr",
            "literal_eval",
            "lambdify",
            "load_all",
        }, name


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for name in FILES:
        for node in nodes(name):
            if isinstance(node, ast.FunctionDef):
                yield name, node


def test_functions_take_few_parameters() -> None:
    many = []
    for name, node in functions():
        a = node.args
        names = [
            arg.arg for arg in (*a.posonlyargs, *a.args, *a.kwonlyargs) if arg.arg not in ("self", "cls")
        ]
        # A command has one parameter for each option of the command line, and so has the public API.
        is_public = name.startswith("lagcli.api.") and node.name in lagcli.__all__
        is_command = name == f"lagcli.cli.commands.{node.name}_command"
        if len(names) > PARAMETERS and not is_command and not is_public:
            many.append(f"{name}.{node.name}: {len(names)}")
    assert not many


def texts() -> Iterator[tuple[Path, str]]:
    """All texts of the repository."""
    folders = [ROOT / name for name in ("lagcli", "tests", "models", "docs", ".ci")]
    assert all(folder.is_dir() for folder in folders)
    # In a worktree of Git `.git` is a file of the machine, not of the repository.
    files = [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    files += [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    for path in files:
        if "__pycache__" not in path.parts and path.suffix not in (
            ".png",
            ".pdf",
            ".npz",
            ".parquet",
            ".pyc",
        ):
            yield path, path.read_text(encoding="utf-8")


def test_nothing_points_out_of_the_repository() -> None:
    machine = r"(?<![\w.~/])/(?:work|root|home|Users|mnt|opt|srv)/"
    above = r"\.\./\.\./\.\./|\.\./" + "shared"
    index = "|".join(r"pypi\.org pythonhosted index-url find-links".split())
    forbidden = re.compile(f"{machine}|{above}|{index}")
    found = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path, text in texts()
        if path != Path(__file__)
        for match in forbidden.finditer(text)
    ]
    assert not found
