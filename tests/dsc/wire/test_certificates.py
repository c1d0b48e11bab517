"""Certificates and access control over Zenoh, with the commands and settings of the page about processes."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from wire_programs import free_endpoint

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.errors import NoAnswerError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_real
from dsc.skills import skill
from dsc.wire import Host, RemoteComponent, ZenohTransport

pytest.importorskip("zenoh", reason="the extra `zenoh` is not installed")
OPENSSL = shutil.which("openssl")
pytestmark = pytest.mark.skipif(OPENSSL is None, reason="certificates are made by openssl")
PAGE = (Path(__file__).parents[3] / "docs" / "processes.md").read_text(encoding="utf-8")
AUTHORITY, CERTIFICATE = re.search(r"```sh\n(.*?)(echo.*?)```", PAGE, re.DOTALL).groups()
(SETTINGS,) = re.findall(r"```json5\n(.*?)```", PAGE, re.DOTALL)


class Lifted(Outcome): ...


class Arm(Component):
    name = "arm"

    @skill
    async def lift(self, call: SkillCall) -> Lifted:
        return Lifted()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Enter a folder in which the commands of the page were executed, for four programs and two authorities."""
    monkeypatch.chdir(tmp_path)
    for authority, programs in {"ca": ("arm", "robot", "guest"), "other": ("stranger",)}.items():
        commands = [AUTHORITY, *(CERTIFICATE.replace("arm", program) for program in programs)]
        text = "\n".join(commands).replace("192.168.0.7", "127.0.0.1")
        text = text.replace("ca.", f"{authority}.") if authority != "ca" else text
        subprocess.run(["/bin/sh", "-ec", text], check=True, capture_output=True)
    return tmp_path


def settings(program, endpoint, authority="ca", *, listens=False):
    """Return the file with the settings of the page for a program."""
    where = endpoint.replace("tcp", "tls")
    text = SETTINGS.replace("arm.key", f"{program}.key").replace("arm.pem", f"{program}.pem")
    text = text.replace("ca.pem", f"{authority}.pem").replace("tls/192.168.0.7:7447", where)
    if not listens:
        text = text.replace("  listen:", "  connect:")
    file = Path(f"{program}.json5")
    file.write_text(text)
    return file


async def lift_as(program, endpoint, authority="ca"):
    """Return the outcome of a skill that a program executes by its certificate."""
    with ZenohTransport(config=settings(program, endpoint, authority)) as transport:
        arm = await RemoteComponent.connect("arm", transport, 3.0)
        return await arm.execute("lift", SkillCall("a1", LoopClock(), print), {})


@pytest.mark.parametrize(
    ("program", "authority", "enters"), [("robot", "ca", True), ("guest", "ca", False), ("stranger", "other", False)]
)
def test_a_program_enters_with_a_certificate_and_a_right(folder, program, authority, enters):
    endpoint = free_endpoint()

    async def main():
        with ZenohTransport(config=settings("arm", endpoint, listens=True)) as transport:
            host = Host(Arm(), transport, LoopClock())
            try:
                return await lift_as(program, endpoint, authority)
            finally:
                await host.close()

    if enters:
        assert run_real(main()) == Outcome("lifted")
    else:
        with pytest.raises(NoAnswerError):
            run_real(main())
