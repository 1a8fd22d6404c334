"""The checker is one file that its parts give, and that needs an interpreter only."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import stability
from stability.checking.assemble import ORDER, TARGET, assembled

FOLDER = Path(stability.__file__).parent / "checking"


def test_the_committed_file_is_what_the_parts_give():
    assert TARGET.read_text(encoding="utf-8") == assembled(), "run python -m stability.checking.assemble"


def test_a_changed_part_changes_the_file(tmp_path):
    for path in FOLDER.glob("*.py"):
        (tmp_path / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    assert assembled(tmp_path) == assembled()
    part = tmp_path / "limits.py"
    part.write_text(part.read_text(encoding="utf-8") + "\n\nEXTRA = 1\n", encoding="utf-8")
    assert "EXTRA = 1" in assembled(tmp_path)


def test_every_part_is_in_the_file():
    assert {path.stem for path in FOLDER.glob("*.py")} - {"__init__", "assemble"} == set(ORDER)


def test_nothing_but_the_standard_library_is_imported_and_nothing_defined_twice():
    tree = ast.parse(TARGET.read_text(encoding="utf-8"))
    modules, names = set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            modules.add(node.module.split(".")[0])
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [n.id for target in node.targets for n in ast.walk(target) if isinstance(n, ast.Name)]
        elif isinstance(node, ast.AnnAssign):
            names.append(node.target.id)
    assert modules <= set(sys.stdlib_module_names)
    assert len(names) == len(set(names))


@pytest.mark.parametrize("part", ORDER)
def test_a_part_uses_only_parts_before_it(part):
    tree = ast.parse((FOLDER / f"{part}.py").read_text(encoding="utf-8"))
    used = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level == 1]
    assert all(ORDER.index(name) < ORDER.index(part) for name in used)


def test_it_runs_alone_in_an_empty_folder(tmp_path):
    (tmp_path / "checker.py").write_text(assembled(), encoding="utf-8")
    command = [sys.executable, "-I", "-S", "-W", "error", "checker.py", "none.json"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2 and "unreadable" in run.stdout and not run.stderr
