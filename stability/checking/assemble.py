"""Writes `stability/checker.py` from the parts of this folder: one file that needs nothing but an interpreter.

Run `python -m stability.checking.assemble` after a change of a part; a test asserts that the committed file is what the
parts give. A part is a module; what it imports from other parts goes, what it imports from the standard library is
gathered at the top, and its docstring stands in the header with what it proves.
"""

from __future__ import annotations

import ast
from pathlib import Path

#: The parts in the order in which they stand; each uses those before it.
ORDER = (
    "limits", "arithmetic", "forms", "fixed", "parsing", "shape", "grammar", "claim", "reference", "statement",
    "structure", "course", "reading", "balance", "targets", "loop", "matrices", "jitter", "lag", "lead", "turn", "sums",
    "responses", "obligation", "impulse", "golden", "effects", "obligations", "member", "motion", "coupling",
    "requirements", "shared", "watch", "command",
)  # fmt: skip
TARGET = Path(__file__).parent.parent / "checker.py"


def assembled(folder: Path = Path(__file__).parent) -> str:
    """The text of the checker."""
    header, plain, named, bodies = [(folder / "__init__.py").read_text(encoding="utf-8").strip('"\n')], set(), {}, []
    made: list[str] = []
    for name in ORDER:
        text = (folder / f"{name}.py").read_text(encoding="utf-8")
        tree, last = ast.parse(text), 0
        for node in tree.body:
            if isinstance(node, ast.Import):
                plain |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                if not node.level and node.module != "__future__":
                    named.setdefault(node.module, set()).update(alias.name for alias in node.names)
            elif node is not tree.body[0]:
                break
            last = node.end_lineno or last
        made += [name for node in tree.body for name in _defined(node)]
        header.append(f"{name}: {ast.get_docstring(tree)}".replace("\n", "\n  ").replace("\n  \n", "\n\n"))
        bodies.append(f"# --- {name} ---\n\n" + "\n".join(text.split("\n")[last:]).strip("\n"))
    if twice := sorted({name for name in made if made.count(name) > 1}):
        raise ValueError(f"two parts define {', '.join(twice)}; rename one of each")
    imports = [f"import {name}" for name in sorted(plain)]
    imports += [f"from {module} import {', '.join(sorted(names, key=_key))}" for module, names in sorted(named.items())]
    top = '"""' + "\n\n".join(header) + '\n"""\n\nfrom __future__ import annotations\n\n' + "\n".join(imports)
    return top + "\n\n" + "\n\n\n".join(bodies) + "\n"


def _defined(node: ast.stmt) -> list[str]:
    """Names that a statement of a module defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]


def _key(name: str) -> tuple[bool, str]:
    return (not name.isupper(), name) if not name[0].islower() else (True, "~" + name)


if __name__ == "__main__":
    TARGET.write_text(assembled(), encoding="utf-8")
