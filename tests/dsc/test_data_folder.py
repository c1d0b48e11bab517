"""Large data by reference: kept as files, bounded by size and age, released (S4.9, S2.20)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc import DataFolder
from knowledge_base.errors import InputError, StoreError

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)


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
        with pytest.raises(InputError, match="released"):
            use(reference)


def test_old_data_are_deleted(tmp_path):
    time = Time()
    data = DataFolder(tmp_path, seconds=10, now=time)
    first = data.keep(b"1", ".bin")
    time.now += 6
    second = data.keep(b"2", ".bin")
    time.now += 6
    assert data.references() == [second]
    with pytest.raises(InputError, match="10 s"):
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
        ("data:9f86d081884c7d65.png", "no data"),
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
        ([1], ".png", "are bytes"),
        (b"", "png", "suffix"),
        (b"", ".p/g", "suffix"),
        (bytes(2000), ".bin", "exceed the bound"),
    ],
)
def test_wrong_data_are_refused(data, suffix, said, tmp_path):
    with pytest.raises(InputError, match=said):
        DataFolder(tmp_path, megabytes=0.001).keep(data, suffix)


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
