"""SQLite's log beside a store: laid out without harm to what it holds, deleted only where a store was moved away."""

import pytest

from knowledge_base.errors import StoreError
from knowledge_base.journal import write_transaction
from knowledge_base.journal.sidecar_files import INDEX, LOG


@pytest.fixture
def path(tmp_path):
    return tmp_path / "world.kb"


def beside(path, ending):
    return path.with_name(path.name + ending)


def test_a_short_log_is_made_longer_after_what_it_holds(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "_LOG_LENGTH", 100)
    beside(path, LOG).write_bytes(b"commits")
    write_transaction.lay_out_log(path)
    assert beside(path, LOG).read_bytes() == b"commits" + bytes(93)


def test_a_long_log_stays_as_it_is(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "_LOG_LENGTH", 3)
    beside(path, LOG).write_bytes(b"commits")
    write_transaction.lay_out_log(path)
    assert beside(path, LOG).read_bytes() == b"commits"


def test_a_log_that_is_a_link_is_refused(path, tmp_path):
    (tmp_path / "other").write_bytes(b"")
    beside(path, LOG).symlink_to(tmp_path / "other")
    with pytest.raises(StoreError, match="cannot lay out the store's log"):
        write_transaction.lay_out_log(path)
    assert (tmp_path / "other").read_bytes() == b""


@pytest.mark.parametrize(
    ("store", "log", "deleted"), [(False, b"", True), (False, b"commits", False), (True, b"", False)],
    ids=["moved away", "with commits", "in use"],
)  # fmt: skip
def test_only_an_empty_log_without_a_store_is_deleted(path, store, log, deleted):
    if store:
        path.write_bytes(b"")
    for ending, content in ((LOG, log), (INDEX, b"index")):
        beside(path, ending).write_bytes(content)
    write_transaction.delete_empty_log(path)
    assert [beside(path, ending).exists() for ending in (LOG, INDEX)] == [not deleted] * 2


def test_without_a_log_nothing_is_deleted(path):
    beside(path, INDEX).write_bytes(b"index")
    write_transaction.delete_empty_log(path)
    assert beside(path, INDEX).exists()
