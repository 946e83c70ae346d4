"""The suite of hard cases, which uses what other tests have: their folders are put on the path."""

import sys
from pathlib import Path

for _folder in (".", "sdf", "render", "scene", "shader"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / _folder))
