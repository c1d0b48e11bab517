"""Files that commands write: never over a store, an input or each other; as a whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from knowledge_base import KnowledgeBase, Schema, output_files
from knowledge_base.errors import InputError
from knowledge_base.output_files import Output, write_all

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)))")


@pytest.fixture(name="store")
def _store(tmp_path: Path) -> Path:
    path = tmp_path / "s.db"
    with KnowledgeBase.open(SCHEMA, path) as kb, kb.transaction(author="test") as tx:
        tx.add_node("red", "cup")
    return path


def names(folder: Path) -> list[str]:
    return [file.name for file in folder.iterdir()]


def ways_to(path: Path) -> dict[str, Path]:
    """Other names of a file that is there."""
    folder = path.parent
    (folder / "dir").mkdir(exist_ok=True)
    (folder / "link").symlink_to(path)
    (folder / "link2").symlink_to(folder / "link")
    (folder / "hard").hardlink_to(path)
    dotted = Path(f"{folder}/./dir/../{path.name}")
    return {
        "itself": path,
        "link": folder / "link",
        "link to it": folder / "link2",
        "hard": folder / "hard",
        "dots": dotted,
    }


# --- stores and other files of the command


def test_a_store_is_no_output_by_whatever_name(store) -> None:
    before = store.read_bytes()
    for path in ways_to(store).values():
        for over in (None, "{"):
            with pytest.raises(InputError, match=r"--to: cannot write '.*': it (is a|belongs to the) store"):
                Output(path, "--to", over=over)
    with store.open("r+b") as opened, pytest.raises(InputError, match="store"):
        Output(f"/dev/fd/{opened.fileno()}", "--to").write("gone")
    assert store.read_bytes() == before


@pytest.mark.parametrize("end", ["-wal", "-shm", "-journal", "-lock", "-world", "-world-wal"])
@pytest.mark.parametrize("there", [False, True])
def test_nothing_that_belongs_to_a_store_is_an_output(store, end: str, *, there: bool) -> None:
    path = store.with_name(store.name + end)
    if there:
        path.touch()
    with pytest.raises(InputError, match=re.escape(f"belongs to the store '{store}'")):
        Output(path, "--to")
    (store.parent / "link").symlink_to(path)
    with pytest.raises(InputError, match="belongs to the store"):
        Output(store.parent / "link", "--to")


def test_a_log_whose_store_is_empty_or_gone_is_kept(store) -> None:
    log = store.with_name("s.db-wal")
    log.write_bytes(b"\x37\x7f\x06\x82" + bytes(100))
    for lose in (lambda: store.write_bytes(b""), store.unlink):
        lose()
        for path in (store, log):
            with pytest.raises(InputError, match="store"):
                Output(path, "--to")


def test_an_output_is_no_other_file_of_the_command(tmp_path) -> None:
    source = tmp_path / "a.yaml"
    source.write_text("mine")
    for path in ways_to(source).values():
        with pytest.raises(InputError, match=re.escape(f"the command needs '{source}' for something else")):
            Output(path, "--svg", None, source)
    out = Output(tmp_path / "b.yaml", "--svg", source)
    with pytest.raises(InputError, match="for something else"):
        out.keep(tmp_path / "dir" / ".." / "b.yaml")
    assert source.read_text() == "mine"


@pytest.mark.parametrize("end", ["", "-wal", "-lock", "-world"])
def test_a_store_that_the_command_will_make_has_its_names_already(tmp_path, end: str) -> None:
    with pytest.raises(InputError, match=r"new\.db"):
        Output(tmp_path / f"new.db{end}", "--trace", tmp_path / "new.db")
    (tmp_path / "link.db").symlink_to(tmp_path / "real.db")
    with pytest.raises(InputError, match=r"(link|real)\.db"):
        Output(tmp_path / f"real.db{end}", "--trace", tmp_path / "link.db")


def test_names_like_those_of_a_store_are_free_where_there_is_none(tmp_path) -> None:
    (tmp_path / "notes").write_text("text")
    Output(tmp_path / "notes-new", "--to", tmp_path / "notes").write("x")
    assert (tmp_path / "notes-new").read_text() == "x"


@pytest.mark.parametrize(
    ("name", "why"),
    [
        (".", "it is a folder"), ("no/where", "there is no folder"), ("file/in", "Not a directory"),
        ("x" * 300, "File name too long"), ("loop", "Too many levels"), ("a\0b", "null"),
    ],
)  # fmt: skip
def test_an_unwritable_output_is_refused_at_once(tmp_path, name: str, why: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(InputError, match=why):
        Output(tmp_path / name, "--to")


# --- whole or not at all


def test_a_file_is_replaced_with_its_mode_and_links_lead_to_it(tmp_path) -> None:
    file = tmp_path / "deep" / "out.svg"
    file.parent.mkdir()
    file.write_text("old")
    file.chmod(0o640)
    (tmp_path / "link").symlink_to("deep/out.svg")
    inode = file.stat().st_ino
    Output(tmp_path / "link", "--svg").write("new ü\r\n")
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == ("new ü\r\n".encode(), 0o640)
    assert (tmp_path / "link").is_symlink()
    assert file.stat().st_ino != inode
    assert names(file.parent) == ["out.svg"]


def test_a_new_file_has_the_mode_that_new_files_have(tmp_path) -> None:
    (tmp_path / "plain").touch()
    (tmp_path / "dangling").symlink_to("out")
    Output(tmp_path / "dangling", "--to").write("new")
    assert (tmp_path / "out").read_text() == "new"
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_an_output_that_cannot_be_encoded_leaves_all_files_unchanged(tmp_path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_text("old")
    first, second = Output(tmp_path / "a", "--to"), Output(tmp_path / "b", "--to")
    with pytest.raises(InputError, match=r"cannot write '.*b': UTF-8 has nothing for '\\ud800'"):
        write_all({first: "new", second: "\ud800"})
    assert [(tmp_path / name).read_text() for name in ("a", "b")] == ["old", "old"]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
@pytest.mark.parametrize("step", ["fsync", "fchmod"])
def test_an_error_half_way_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, error, step: str) -> None:
    file = tmp_path / "out"
    file.write_text("old")

    def failing(*_: object) -> None:
        raise error

    monkeypatch.setattr(os, step, failing)
    with pytest.raises(type(error)) as raised:
        Output(file, "--to").write("new")
    assert getattr(raised.value, "filename", str(file)) == str(file)
    assert (file.read_text(), names(tmp_path)) == ("old", ["out"])


def test_a_process_that_dies_half_way_leaves_the_old_file(tmp_path) -> None:
    file = tmp_path / "out.yaml"
    file.write_text("old")
    code = """
import os, signal, sys
from knowledge_base.output_files import Output
os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
Output(sys.argv[1], "--to").write("new" * 100_000)
"""
    assert subprocess.run([sys.executable, "-c", code, file], check=False).returncode == -9
    assert file.read_text() == "old"
    assert [name for name in names(tmp_path) if name.endswith(".yaml")] == ["out.yaml"]


def test_a_full_medium_leaves_the_old_file(tmp_path) -> None:
    file = tmp_path / "out"
    file.write_text("old")
    code = """
import resource, sys
from knowledge_base.output_files import Output
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    Output(sys.argv[1], "--to").write("new" * 100_000)
except OSError as error:
    print(error.strerror, error.filename)
"""
    done = subprocess.run([sys.executable, "-c", code, file], check=False, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (f"File too large {file}\n", "")
    assert (file.read_text(), names(tmp_path)) == ("old", ["out"])


# --- what cannot be replaced


def test_standard_output_and_descriptors_are_written_in_place(tmp_path, capfd) -> None:
    for name in ("-", "/dev/stdout", "/dev/fd/1"):
        Output(name, "--to").write(f"to {name}\n")
    assert capfd.readouterr().out == "to -\nto /dev/stdout\nto /dev/fd/1\n"
    file = tmp_path / "log"
    file.write_text("before ")
    with file.open("a") as log:
        (tmp_path / "link").symlink_to(f"/dev/fd/{log.fileno()}")
        inode = file.stat().st_ino
        Output(tmp_path / "link", "--to").write("after")
    assert (file.read_text(), file.stat().st_ino) == ("before after", inode)


def test_a_descriptor_that_cannot_be_written_is_refused(tmp_path) -> None:
    (tmp_path / "x").touch()
    with (tmp_path / "x").open() as opened, pytest.raises(InputError, match="open only to be read"):
        Output(f"/dev/fd/{opened.fileno()}", "--to")
    with pytest.raises(InputError, match="Bad file descriptor"):
        Output("/dev/fd/900", "--to")


def test_a_fifo_gets_the_text_and_stays(tmp_path) -> None:
    fifo, got = tmp_path / "fifo", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: got.append(fifo.read_text()))
    reader.start()
    Output(fifo, "--to").write("x" * 100_000)
    reader.join()
    assert got == ["x" * 100_000]
    assert stat.S_ISFIFO(fifo.stat().st_mode)


def test_a_fifo_that_nobody_reads_is_not_waited_for(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(output_files, "PATIENCE_S", 0.0)
    os.mkfifo(tmp_path / "fifo")
    out = Output(tmp_path / "fifo", "--to")
    with pytest.raises(InputError, match="it has no reader"):
        out.write("x")
    with pytest.raises(InputError, match="it has no reader"), out.stream():
        pass


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes devices")
def test_a_device_is_written_and_stays_and_a_disk_is_refused(tmp_path) -> None:
    null, disk = tmp_path / "null", tmp_path / "disk"
    try:
        os.mknod(null, stat.S_IFCHR | 0o666, os.makedev(1, 3))
        os.mknod(disk, stat.S_IFBLK | 0o600, os.makedev(7, 200))
        Output(null, "--to").write("x")
    except OSError:
        pytest.skip("no devices can be made or opened here")
    with Output(null, "--trace", over="{").stream() as stream:
        stream.write("x")
    assert stat.S_ISCHR(null.stat().st_mode)
    with pytest.raises(InputError, match="it is a disk"):
        Output(disk, "--to")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_a_full_device_is_named(tmp_path) -> None:
    with pytest.raises(OSError, match="No space left") as full:
        Output("/dev/full", "--to").write("x")
    assert full.value.filename == "/dev/full"


# --- streams


def test_a_stream_empties_only_what_begins_like_its_own(tmp_path) -> None:
    for name, text in (("mine", '{"format"\nold'), ("empty", ""), ("notes", "my notes"), ("short", '{"')):
        (tmp_path / name).write_text(text)
    for name in ("mine", "empty", "new"):
        with Output(tmp_path / name, "--trace", over='{"format"').stream() as stream:
            stream.write("line\n")
            assert (tmp_path / name).read_text() == "line\n"  # while it goes on
    for name in ("notes", "short"):
        before = (tmp_path / name).read_text()
        with pytest.raises(InputError, match="it exists already and is not a file of that kind"):
            Output(tmp_path / name, "--trace", over='{"format"')
        assert (tmp_path / name).read_text() == before


def test_a_file_that_appears_after_the_check_is_not_overwritten(tmp_path) -> None:
    streamed, written = Output(tmp_path / "a", "--trace", over="{"), Output(tmp_path / "b", "--to")
    (tmp_path / "a").write_text("notes")
    with pytest.raises(InputError, match="not a file of that kind"), streamed.stream():
        pass
    with KnowledgeBase.open(SCHEMA, tmp_path / "b"), pytest.raises(InputError, match="it is a store"):
        written.write("x")
    assert (tmp_path / "a").read_text() == "notes"


def test_two_streams_do_not_share_a_file(tmp_path) -> None:
    first, second = (Output(tmp_path / "t", "--trace", over="{") for _ in range(2))
    with first.stream() as stream:
        stream.write("{}\n")
        with pytest.raises(InputError, match="another program is writing it"), second.stream():
            pass
    assert (tmp_path / "t").read_text() == "{}\n"
