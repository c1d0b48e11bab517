"""A sample of `make fuzz`: the corpus as it is, and some of its mutations; and the judge finds what it looks for."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from operator import attrgetter
from pathlib import Path
from random import Random

import fuzz
import fuzz_commands
import fuzz_mutation
import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")

from fuzz_commands import COMMANDS, NEVER, TARGETS, commands
from fuzz_readers import HOME, READERS, Target

KEPT = sorted(file for file in (HOME / "corpus").glob("*/*") if file.parent.name != "command")
CALLS = sorted((HOME / "corpus" / "command").glob("*.json"))
SLOW = ("run-", "kb-draw")
"""Calls that `make fuzz` makes alone."""
NUMBERS = range(18)
"""Mutations of each target here."""

OPEN = ()
"""Targets that still have findings; `make fuzz ONLY=...` names them."""
SAMPLED = [
    pytest.param(target, marks=[pytest.mark.xfail(strict=False, reason="open findings")] if target.name in OPEN else [])
    for target in READERS
    if not target.name.endswith("-store")
]


@pytest.mark.parametrize("target", SAMPLED, ids=lambda target: target.name)
def test_a_sample_of_mutations_ends_as_it_may(target):
    found = [fuzz.tried(fuzz.case_of(0, number, (target.name,))) for number in NUMBERS]
    assert [one.said for one in found if one] == []


@pytest.mark.parametrize("file", KEPT, ids=lambda file: f"{file.parent.name}/{file.name}")
def test_a_corpus_file_causes_no_finding(file):
    found = fuzz.tried(fuzz.Case(file.parent.name, file.read_bytes()))
    assert found is None, found.said


@pytest.mark.parametrize(
    "file", [file for file in CALLS if not any(slow in file.name for slow in SLOW)], ids=lambda file: file.stem
)
def test_calls_end_as_they_may(file):
    found = fuzz.tried(fuzz.Case("command", file.read_bytes()))
    assert found is None, found.said


def test_an_input_depends_on_seed_and_number_alone():
    assert [fuzz.case_of(3, number) for number in range(40)] == [fuzz.case_of(3, number) for number in range(40)]
    assert (
        len({fuzz.case_of(3, number) for number in range(40)} | {fuzz.case_of(4, number) for number in range(40)}) > 70
    )


def test_every_command_and_option_is_drawn():
    """Those of the app itself, so that a new one is covered the day it appears."""
    declared = {
        (words, option)
        for words, params in commands().items()
        for one in params
        for option in one.opts
        if option.startswith("-")
    }
    drawn, random = set(), Random(0)
    for _ in range(60):
        for words in commands():
            drawn |= {(words, one) for one in fuzz_commands._drawn(random, words, {})}
    assert declared - drawn == set()
    assert set(NEVER) <= {option for _, option in declared}
    assert {words[0] for words in commands() if words} >= {"plot", "kb", "runs", "plan", "view", "run"}


def test_no_call_names_anything_outside_of_its_folder():
    for number in range(300):
        call = json.loads(COMMANDS.vary(Random(number)))
        assert not [one for one in call["argv"] if one.startswith(("/", "~")) or "=/" in one or one.count("..") > 1]


def test_every_target_has_a_corpus_and_its_own_share():
    assert {target.name for target in TARGETS} == {folder.name for folder in (HOME / "corpus").iterdir()}
    assert all(target.share > 0 and target.seeds() for target in TARGETS)


# -- the judge itself ------------------------------------------------------------------------------------


def raising(data, folder):
    if b"!" in data:
        raise KeyError(data)


@pytest.fixture
def judged(monkeypatch):
    def install(read):
        monkeypatch.setattr(fuzz, "targets", lambda: (Target("t", read),))

    return install


def test_an_exception_of_no_kind_of_ours_is_a_finding(judged):
    judged(raising)
    assert fuzz.tried(fuzz.Case("t", b"fine")) is None
    assert fuzz.tried(fuzz.Case("t", b"wrong!")).where == "t: KeyError, elsewhere"


def test_a_call_that_ends_with_another_status_or_a_traceback_is_a_finding(monkeypatch):
    for end in (lambda: sys.exit(9), lambda: print("Traceback (most recent call last)"), lambda: 1 / 0):
        monkeypatch.setattr(fuzz_commands, "main", end)
        assert fuzz.tried(fuzz.Case("command", b'{"argv": ["plan"]}')) is not None


def test_a_hang_is_a_finding_and_the_others_go_on(tmp_path):
    """A whole campaign over one target, in processes of its own."""
    (tmp_path / "campaign.py").write_text(CAMPAIGN)
    environment = {**os.environ, "PYTHONPATH": str(Path(fuzz.__file__).parent)}
    process = subprocess.Popen(
        [sys.executable, tmp_path / "campaign.py"],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )
    try:
        said, _ = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert "t: hang (reader)" in said
    assert "t: MemoryError" in said
    assert "2 findings" in said
    assert process.returncode == 1


CAMPAIGN = """
import time
import fuzz

class Three:
    name, share = "t", 1

    @staticmethod
    def vary(random):
        return random.choice((b"hang", b"grow", b"fine"))

    @staticmethod
    def read(data, folder):
        if data == b"hang":
            time.sleep(60)
        if data == b"grow":
            bytearray(3 << 30)

fuzz.targets = lambda: (Three,)
fuzz.fine = lambda: ()
fuzz.prepare = lambda: None
fuzz.smaller = lambda finding: finding
fuzz.kept = lambda finding: "-"
fuzz.HANG_S = 0.1

if __name__ == "__main__":
    import sys
    sys.exit(fuzz.Campaign(0, 60.0, 6, 1, ()).run())
"""


@pytest.mark.parametrize(
    "mutation", sorted({*fuzz_mutation.TEXT, *fuzz_mutation.JSON, *fuzz_mutation.LINES}, key=attrgetter("__name__"))
)
def test_a_mutation_takes_any_input(mutation):
    inputs = (b"", b"a", b"(a (b c) 1.5)", b"\xff\x00", b'{"a": [1, {"b": null}]}', b"<a><b/></a>", b"\n\n")
    for number, data in enumerate(inputs * 20):
        assert isinstance(mutation(data, Random(number), inputs, (b"token",)), bytes)
