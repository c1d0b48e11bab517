"""Readers use the unsaved texts of an editor in place of the files on disk."""

from __future__ import annotations

import pytest

from dsc.text.plot_files import load_library
from knowledge_base.errors import InputError
from knowledge_base.pddl.files import read_text
from knowledge_base.pddl.unsaved_texts import unsaved_text, unsaved_texts

PLOT = "plot: {name}\nstates:\n  a: {{final: true}}\n"


def test_unsaved_texts_hide_the_files_until_the_end_of_the_block(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text(PLOT.format(name="saved"))
    (tmp_path / "link.yaml").symlink_to(file)
    with unsaved_texts({file: PLOT.format(name="unsaved 🚪")}):
        assert "unsaved 🚪" in read_text(file)
        assert "unsaved 🚪" in read_text(tmp_path / "link.yaml")
        with unsaved_texts({}):
            assert "saved" in read_text(file)
    assert unsaved_text(file) is None
    assert read_text(file) == PLOT.format(name="saved")


def test_a_library_has_the_unsaved_plots(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(PLOT.format(name=name))
    with unsaved_texts({tmp_path / "a.yaml": PLOT.format(name="changed")}):
        assert [plot.name for plot in load_library(tmp_path)] == ["changed", "b"]


def test_an_unsaved_text_may_not_exceed_the_size_either(tmp_path):
    file = tmp_path / "a.yaml"
    with unsaved_texts({file: "x" * 11}), pytest.raises(InputError, match="at most 10 are read"):
        read_text(file, most=10)
