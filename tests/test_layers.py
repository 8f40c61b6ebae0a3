"""Arrows go one way: each package imports only what lies beneath it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1] / "facewright"
BASE = {"data", "conventions", "errors", "mesh", "solve", "working_set", "blending"}
ALLOWED = {
    "mesh": {"errors", "conventions", "solve"},
    "solve": {"errors"},
    "read": BASE,
    "template": BASE | {"scan"},
    "scan": BASE,
    "transfer": BASE,
    "register": BASE | {"scan", "transfer"},
    "contact": BASE | {"transfer", "expand"},
    "parts": BASE | {"transfer"},
    "bake": BASE,
    "evaluate": BASE | {"expand"},
    "compress": BASE | {"read", "write"},
    "write": BASE | {"evaluate", "bake", "parts", "template"},
}


def imported_packages(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if name.startswith("facewright."):
                yield name.split(".")[1]


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_a_package_imports_only_what_lies_beneath(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        wrong = set(imported_packages(path)) - ALLOWED[package] - {package}
        assert not wrong, f"{path.relative_to(ROOT)} imports {sorted(wrong)}"


def test_importing_the_package_loads_nothing_heavy():
    code = "import sys, facewright; print([m for m in ('torch', 'pxr', 'bpy', 'mediapipe', 'cv2') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
