"""Large data by reference: kept as files, bounded by size and age, released (S4.9, S2.20)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc import Component, DataFolder, Outcome, SkillCall, parse_plot, skill
from dsc.errors import LostDataError
from knowledge_base.errors import InputError, StoreError
from planning import Robot

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)


class Measured(Outcome):
    nearest: float


class Time:
    def __init__(self):
        self.now = 1_000_000.0

    def __call__(self):
        return self.now


def test_data_are_read_by_their_reference(tmp_path):
    data = DataFolder(tmp_path / "data")
    assert not (tmp_path / "data").exists()
    picture, scan = data.keep(PNG, ".png"), data.keep([0.5] * 360)
    assert data.read(picture) == PNG
    assert data.read(scan) == [0.5] * 360
    assert data.file(picture).read_bytes() == PNG
    assert picture.startswith("data:")
    assert picture.endswith(".png")
    assert data.keep(PNG, ".png") == picture
    assert data.references() == [scan, picture]  # kept again: the newest


def test_a_later_program_reads_the_data_of_an_earlier_one(tmp_path):
    time = Time()
    reference = DataFolder(tmp_path, now=time).keep(PNG, ".png")
    time.now += 60
    later = DataFolder(tmp_path, now=time)
    assert later.read(reference) == PNG
    assert later.age(reference) == 60


def test_programs_at_the_same_time(tmp_path):
    camera, detector = DataFolder(tmp_path), DataFolder(tmp_path)
    assert detector.read(camera.keep(PNG, ".png")) == PNG


def test_released_data_are_gone(tmp_path):
    data = DataFolder(tmp_path)
    reference = data.keep(PNG, ".png")
    data.release(reference)
    assert list(tmp_path.iterdir()) == []
    for use in (data.read, data.file, data.age, data.release):
        with pytest.raises(LostDataError, match="released"):
            use(reference)


def test_old_data_are_deleted(tmp_path):
    time = Time()
    data = DataFolder(tmp_path, seconds=10, now=time)
    first = data.keep(b"1", ".bin")
    time.now += 6
    second = data.keep(b"2", ".bin")
    time.now += 6
    assert data.references() == [second]
    with pytest.raises(LostDataError, match="10 s"):
        data.read(first)


@given(
    st.lists(
        st.one_of(
            st.binary(min_size=1, max_size=60), st.integers(1, 40).map(lambda n: ("release", n)), st.floats(0, 5)
        ),
        max_size=40,
    )
)
def test_the_folder_stays_within_its_bounds(tmp_path_factory, steps):
    time, folder = Time(), tmp_path_factory.mktemp("data")
    data = DataFolder(folder, megabytes=100 / 1e6, seconds=10, now=time)
    kept: dict[str, tuple[bytes, float]] = {}
    for step in steps:
        if isinstance(step, float):
            time.now += step
        elif isinstance(step, tuple):
            references = data.references()
            if references:
                data.release(references[step[1] % len(references)])
        else:
            kept[data.keep(step, ".bin")] = step, time.now
        references, files = data.references(), list(folder.iterdir())
        assert sum(one.stat().st_size for one in files) <= 100
        assert {f"data:{one.name}" for one in files} == set(references)
        for reference in references:
            content, at = kept[reference]
            assert data.read(reference) == content
            assert data.age(reference) == pytest.approx(time.now - at)
            assert data.age(reference) <= 10


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        ("data:../../etc/passwd", "is not a reference"),
        ("data:9f86d081884c7d65.png/..", "is not a reference"),
        ("9f86d081884c7d65.png", "is not a reference"),
        (5, "is not a reference"),
    ],
)
def test_wrong_references_are_refused(reference, said, tmp_path):
    with pytest.raises(InputError, match=said):
        DataFolder(tmp_path).read(reference)


@pytest.mark.parametrize(
    ("data", "suffix", "said"),
    [
        ([float("nan")], ".json", "plain data"),
        (object(), ".json", "plain data"),
        (object(), "", "plain data"),
        ([1], ".png", "bytes another one, not '.png'"),
        (b"[1", ".json", "bytes another one, not '.json'"),
        ({None: 1}, "", "a key is a text, not None"),
        ([{1: 2}], "", "a key is a text, not 1"),
        ({"a": 1, 2: 3}, "", "a key is a text, not 2"),
        (b"", "png", "suffix"),
        (b"", ".p/g", "suffix"),
        (bytes(2000), ".bin", "exceed the bound"),
    ],
)
def test_wrong_data_are_refused(data, suffix, said, tmp_path):
    with pytest.raises(InputError, match=said):
        DataFolder(tmp_path, megabytes=0.001).keep(data, suffix)


def test_data_that_are_nested_too_deep(tmp_path):
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    with pytest.raises(InputError, match="plain data"):
        DataFolder(tmp_path).keep(deep)


def test_the_usual_suffixes(tmp_path):
    data = DataFolder(tmp_path)
    raw = data.keep(b"\xff")
    assert raw.endswith(".bin")
    assert data.read(raw) == b"\xff"
    assert data.keep({"a": 1, "b": 2}) == data.keep({"b": 2, "a": 1})
    assert data.read(data.keep({"b": 2, "a": (1, None)})) == {"a": [1, None], "b": 2}


@pytest.mark.parametrize("suffix", [".png", ""])
def test_a_changed_file(suffix, tmp_path):
    data = DataFolder(tmp_path)
    given = PNG if suffix else [1, 2, 3]
    reference = data.keep(given, suffix)
    for damage in (b"[1,2,", b"", b"[1,2,4]"):
        data.file(reference).write_bytes(damage)
        with pytest.raises(LostDataError, match="was changed"):
            data.read(reference)
        assert data.keep(given, suffix) == reference
        assert data.read(reference) == given


def test_a_skill_that_reads_released_data_ends_with_a_skill_error(tmp_path):
    data = DataFolder(tmp_path)

    class Map(Component):
        name = "map"

        @skill
        async def measure(self, call: SkillCall) -> Measured:
            reference = data.keep([1, 2])
            data.release(reference)
            return Measured(nearest=min(data.read(reference)))

    text = (
        "{plot: p, states: {a: {entry: {trigger: map.measure}, on: {measured: {}, skill_error: e}}, e: {final: true}}}"
    )
    with Robot("(define (domain d) (:predicates (p)))", [parse_plot(text)], [Map()], clock="simulated") as robot:
        assert robot.run("p").reached


@pytest.mark.parametrize("bounds", [{"megabytes": 0}, {"seconds": -1}, {"megabytes": "many"}])
def test_wrong_bounds_are_refused(bounds, tmp_path):
    with pytest.raises(InputError, match="positive number"):
        DataFolder(tmp_path, **bounds)


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be written"):
        DataFolder(tmp_path / "file").keep(PNG, ".png")


def test_many_threads(tmp_path):
    data = DataFolder(tmp_path, megabytes=0.01)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda n: data.keep(bytes([n % 50]) * 500, ".bin"), range(400)))
    assert sum(one.stat().st_size for one in tmp_path.iterdir()) <= 10_000
