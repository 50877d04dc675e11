"""Write the JSON Schema of scene files, docs/scene.schema.json: python -m tools.schema."""

from pathlib import Path

import tsdyn as ts
from tsdyn.files.schema import text

TARGET = Path(__file__).parents[1] / "docs" / "scene.schema.json"

if __name__ == "__main__":
    TARGET.write_text(text(ts.Scene, ts.simulate), encoding="utf-8")
