"""The keys of a page: none in a command line stays one, and cookies of other programs do not hide ours."""

from __future__ import annotations

import asyncio
import webbrowser
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import HTTPCookieProcessor, OpenerDirector, build_opener

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")
httpx = pytest.importorskip("httpx", reason="the extra `viewer` is not installed")

from dsc.cli.view import page  # noqa: E402
from dsc.trace import header  # noqa: E402
from dsc.viewer.access import (  # noqa: E402
    CODE_LIFE_S,
    MOST_WRONG_CODES,
    Access,
    Keys,
    PageAddress,
)
from dsc.viewer.live import LivePage  # noqa: E402
from dsc.viewer.records import RecordLog  # noqa: E402
from dsc.viewer.server import Viewer  # noqa: E402

PORT = 4711
OURS = f"dsc-view-{PORT}"


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


async def welcome(_scope, _receive, send) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"welcome"})


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def keys(clock) -> Keys:
    return Keys("TOKEN", "CODE", clock)


@pytest.fixture
def get(keys):
    """A request by a stranger, who keeps no cookies."""
    access = Access(welcome, keys, PORT)

    def get(path: str = "/", *cookies: str, method: str = "GET"):
        async def asking():
            transport = httpx.ASGITransport(app=access)
            async with httpx.AsyncClient(transport=transport, base_url=f"http://127.0.0.1:{PORT}") as client:
                return await client.request(method, path, headers=[("Cookie", one) for one in cookies])

        return asyncio.run(asking())

    return get


def test_a_code_opens_the_page_once_and_the_cookie_that_it_brings_stays(get, keys) -> None:
    opened = get("/?code=CODE")
    assert opened.status_code == 200
    cookie = opened.headers["set-cookie"]
    assert cookie == f"{OURS}={keys.cookie}; HttpOnly; SameSite=Strict; Path=/"
    assert get("/?code=CODE").status_code == 403
    assert "used up" in get("/?code=CODE").text
    own = cookie.partition(";")[0]
    assert get("/?code=CODE", own).status_code == 200  # the page reloaded before it cleaned its address
    assert get("/", own).status_code == 200
    assert get("/record/1", own).status_code == 200


def test_a_code_dies_of_age_and_of_guesses(get, keys, clock) -> None:
    for guess in range(MOST_WRONG_CODES - 1):
        assert get(f"/?code={guess}").status_code == 403
    clock.now = CODE_LIFE_S - 1
    assert get("/?code=CODE").status_code == 200
    late = Keys("TOKEN", "CODE", clock)
    clock.now += CODE_LIFE_S
    assert not late.redeem("CODE")
    guessed = Keys("TOKEN", "CODE", clock)
    assert [guessed.redeem(str(guess)) for guess in range(MOST_WRONG_CODES)] == [False] * MOST_WRONG_CODES
    assert not guessed.redeem("CODE")


def test_a_page_that_opens_no_browser_has_no_code() -> None:
    keys = Keys("TOKEN", None)
    assert not keys.redeem("")
    assert not keys.redeem("None")


@pytest.mark.parametrize(("path", "method"), [("/record/1", "GET"), ("/query", "POST"), ("/", "POST"), ("/", "HEAD")])
def test_a_code_is_for_the_page_alone_and_what_is_refused_does_not_use_it_up(get, path, method) -> None:
    assert get(f"{path}?code=CODE", method=method).status_code == 403
    assert get("/?code=CODE").status_code == 200


def test_the_token_opens_as_often_as_anybody_likes_and_the_cookie_is_not_the_token(get, keys, clock) -> None:
    clock.now = 10 * CODE_LIFE_S
    for _ in range(3):
        answer = get("/?token=TOKEN")
        assert answer.status_code == 200
        assert "TOKEN" not in answer.headers["set-cookie"]
    assert get("/", f"{OURS}=TOKEN").status_code == 403
    assert get(f"/?token={keys.cookie}").status_code == 403


FOREIGN = [
    "junk",
    "=",
    "={}",
    "a b=c",
    "[x]=y; @=1",
    'q="a;b\\"c"',
    'open="',
    "ünï=cödé",
    "\x01\x02=\x03",
    "big=" + "x" * 60_000,
    f"{OURS}=of-another-program",
    f"{OURS}",
    f"{OURS}-x=1",
    f"x{OURS}=1",
    "; ;;",
    "expires=Thu, 01 Jan 1970 00:00:00 GMT; path=/; domain",
]


@pytest.mark.parametrize("foreign", FOREIGN)
def test_cookies_of_other_programs_do_not_hide_ours(get, keys, foreign) -> None:
    ours = f"{OURS}={keys.cookie}"
    foreign = foreign.encode().decode("latin-1")
    for sent in (
        [f"{foreign}; {ours}"],
        [f"{ours}; {foreign}"],
        [foreign, ours],
        [f'{foreign}; {OURS}="{keys.cookie}"'],
    ):
        assert get("/", *[one.encode("latin-1") for one in sent]).status_code == 200
    assert get("/", foreign.encode("latin-1")).status_code == 403


def test_a_refusal_is_not_cached_and_sends_no_referrer(get) -> None:
    answer = get("/?token=wrong")
    assert (answer.headers["cache-control"], answer.headers["referrer-policy"]) == ("no-store", "no-referrer")


@pytest.mark.parametrize(
    "query", ["token=%ff%fe", "token=%ED%A0%80", "&" * 5000, "token", "token=&token=", "code=%00", "code="]
)
def test_malformed_addresses_are_refused(get, query) -> None:
    assert get(f"/?{query}").status_code == 403


def status(url: str, browser: OpenerDirector | None = None) -> int:
    """How a browser is answered, a new one if none is given."""
    try:
        with (browser or build_opener()).open(url, timeout=60) as answer:
            return int(answer.status)
    except HTTPError as refused:
        return refused.code


@pytest.fixture
def opened(monkeypatch) -> list[str]:
    """What browsers are given on their command line."""
    addresses: list[str] = []

    def given(url: str) -> bool:
        addresses.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", given)
    return addresses


def test_the_browser_is_given_a_code_and_people_the_token(opened, capsys) -> None:
    entrance = PageAddress.on()
    with page(Viewer(RecordLog(), entrance), opens=True) as viewer:
        printed = capsys.readouterr().out.strip()
        (given,) = opened
        assert entrance.token in printed
        assert entrance.token not in given
        browser = build_opener(HTTPCookieProcessor())
        assert status(given, browser) == 200
        assert status(f"http://127.0.0.1:{viewer.port}/", browser) == 200  # reloaded, or a second tab
        assert [status(given), status(printed), status(printed)] == [403, 200, 200]


def test_a_machine_without_a_browser_prints_the_address(monkeypatch, capsys) -> None:
    def none(_url: str) -> bool:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "open", none)
    with page(Viewer(RecordLog(), PageAddress.on()), opens=True) as viewer:
        assert capsys.readouterr().out.strip() == viewer.url


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="there is no /proc on this system")
def test_nobody_reads_a_key_from_the_process_that_serves_the_page(opened) -> None:
    entrance = PageAddress.on()
    with page(LivePage(header(), entrance), opens=True) as live:
        assert status(opened[0]) == 200  # its process has started
        folder = Path("/proc") / str(live._process.pid)
        seen = (folder / "cmdline").read_bytes() + (folder / "environ").read_bytes()
        assert b"page_process" in seen
        assert [key for key in (entrance.token, entrance.code) if key.encode() in seen] == []
        assert status(opened[0]) == 403
