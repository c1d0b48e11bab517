"""The project of the tutorial's end: what `dsc new` makes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from planning.cli.new import new_command


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("projects")
    before = Path.cwd()
    os.chdir(folder)
    try:
        new_command("porter")
    finally:
        os.chdir(before)
    return folder / "porter"


@pytest.fixture
def project(template: Path, tmp_path: Path) -> Path:
    import shutil

    home = tmp_path / "porter"
    shutil.copytree(template, home)
    return home
