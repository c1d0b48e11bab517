"""The benchmark of the way from a failure to the new plan's first action measures what it says."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


def test_each_part_of_the_way_to_the_new_plan_is_measured():
    code = "import json, replanning; print(json.dumps([replanning.PARTS, replanning.measured(9)]))"
    run = subprocess.run([sys.executable, "-c", code], cwd=BENCHMARKS, capture_output=True, text=True, check=True)
    parts, spent = json.loads(run.stdout)
    assert list(spent) == parts
    assert all(spent[part] > 0 for part in ("mend", "validate, de-order", "generate", parts[-1]))
