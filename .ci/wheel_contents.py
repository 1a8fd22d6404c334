"""Check what a wheel holds: the four packages with their type markers and data, and nothing else."""

import sys
import zipfile

PACKAGES = ("hdmm_opt", "trajectories", "stability", "tuning")
NEEDED = (
    *(f"{package}/py.typed" for package in PACKAGES),
    "hdmm_opt/studies/emla-p2.toml",
    "hdmm_opt/schema/gains-2.schema.json",
    "stability/checker.py",
)


def problems(names: list[str]) -> list[str]:
    """What is missing or has no place in the wheel."""
    missing = [f"missing: {name}" for name in NEEDED if name not in names]
    allowed = (*(f"{package}/" for package in PACKAGES), "hdmm_opt-")
    return missing + [
        f"has no place: {name}" for name in names if not name.startswith(allowed) or "__pycache__" in name
    ]


def main(path: str) -> int:
    """Print the problems of one wheel."""
    with zipfile.ZipFile(path) as wheel:
        found = problems(wheel.namelist())
        print("\n".join(found) or f"{len(wheel.namelist())} files, as they should be")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
