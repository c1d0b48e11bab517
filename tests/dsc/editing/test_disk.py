"""Files on disk, kept by their time of change: each answer has the present texts, also those of other programs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.editing.disk import Disk
from knowledge_base.pddl.unsaved_texts import unsaved_texts

YEAR_NS = 365 * 24 * 3600 * 10**9
LATER = 2_000_000_000 * 10**9


def texts(disk, root):
    return {file.relative_to(root).as_posix(): disk.text(file) for file in disk.files_in(root, {".yaml"})}


def age(path, ns):
    os.utime(path, ns=(ns, ns))


@given(
    st.lists(
        st.tuples(st.sampled_from(["write", "remove", "age"]), st.sampled_from(["a.yaml", "b/c.yaml", "b/d.txt"])),
        max_size=12,
    )
)
def test_changes_by_another_program(tmp_path_factory, changes):
    root = tmp_path_factory.mktemp("project")
    (root / "b").mkdir()
    disk = Disk()
    for number, (change, name) in enumerate(changes):
        file = root / name
        if change == "write":
            file.write_text(str(number))
        elif file.exists():
            file.unlink() if change == "remove" else age(file, YEAR_NS + number)
        assert texts(disk, root) == {one.relative_to(root).as_posix(): one.read_text() for one in root.rglob("*.yaml")}


@pytest.fixture
def project(tmp_path):
    (tmp_path / "a.yaml").write_text("one")
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git/b.yaml").write_text("hidden")
    age(tmp_path / "a.yaml", YEAR_NS)
    age(tmp_path, YEAR_NS)
    return tmp_path


def test_a_settled_file_that_is_read_once(project, monkeypatch):
    disk = Disk(lambda: LATER)
    assert texts(disk, project) == {"a.yaml": "one"}
    monkeypatch.delattr(Path, "read_text")
    monkeypatch.delattr(os, "scandir")
    assert texts(disk, project) == {"a.yaml": "one"}


def test_two_changes_with_one_time(project):
    disk = Disk(lambda: YEAR_NS + 10**9)  # a second after the first change
    assert texts(disk, project) == {"a.yaml": "one"}
    (project / "a.yaml").write_text("two")
    (project / "b.yaml").write_text("new")
    age(project / "a.yaml", YEAR_NS)
    age(project, YEAR_NS)
    assert texts(disk, project) == {"a.yaml": "two", "b.yaml": "new"}


def test_an_unsaved_text_and_a_file_that_is_gone(project):
    disk, file = Disk(lambda: LATER), project / "a.yaml"
    with unsaved_texts({file: "mine"}):
        assert disk.text(file) == "mine"
    assert disk.text(file) == "one"
    file.unlink()
    assert disk.text(file) == ""
    assert texts(disk, project / "none") == {}
