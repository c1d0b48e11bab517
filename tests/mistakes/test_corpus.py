"""The corpus of mistakes fits the project that `dsc new` makes, and the page of the documentation fits the corpus.

`make mistakes` runs the command on each of them.
"""

from __future__ import annotations

import subprocess

import pytest
from answer_mistakes import DSC, TABLE, corpus, plant, table

MISTAKES = corpus()


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    subprocess.run([DSC, "new", "porter"], cwd=folder, check=True, capture_output=True)
    return folder / "porter"


def test_each_mistake_is_in_a_file_of_a_new_project(project):
    texts = {file: file.read_text() for file in project.rglob("*") if file.is_file()}
    for mistake in MISTAKES:
        plant(mistake, project)
        for file, text in texts.items():
            file.write_text(text)


def test_the_page_has_the_corpus():
    assert TABLE.read_text() == table(MISTAKES)


def test_more_than_half_was_planted_by_somebody_else():
    assert sum(mistake["origin"] == "outside" for mistake in MISTAKES) * 2 > len(MISTAKES) >= 60
    assert sum(mistake["kind"] == "python" for mistake in MISTAKES) >= 25
