"""`dsc check` reads the scenario files of a project with the robot's simulation."""

from __future__ import annotations

from pathlib import Path

from domains.butler.bringup import bundle
from knowledge_base.errors import collecting
from planning.robot.scenario_files import check_scenarios

ROOT = Path(__file__).parents[3]
SHIPPED = ROOT / "domains" / "butler" / "scenarios"


def errors_of(folder: Path) -> list[str]:
    with collecting() as errors:
        check_scenarios(bundle(), sorted(folder.iterdir()))
    return [str(one) for one in errors]


def test_the_shipped_scenarios_have_no_mistakes():
    assert any(SHIPPED.iterdir())
    assert errors_of(SHIPPED) == []


def test_a_mistake_has_its_file_line_and_nearest_key_and_hides_no_other(tmp_path):
    folder = tmp_path / "scenarios"
    folder.mkdir()
    (folder / "a.yaml").write_text("says: [hello]\nclosd: [hall-kitchen]\n")
    (folder / "b.yaml").write_text("says: [\n")
    (folder / "notes.txt").write_text("no scenario")
    first, second = errors_of(folder)
    assert first.startswith(f"{folder / 'a.yaml'}:2:1")
    assert "did you mean 'closed'?" in first
    assert second.startswith(f"{folder / 'b.yaml'}:2")


def test_other_folders_have_no_scenarios(tmp_path):
    (tmp_path / "a.yaml").write_text("closd: []\n")
    assert errors_of(tmp_path) == []
