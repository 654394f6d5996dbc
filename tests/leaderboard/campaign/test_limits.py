"""What an estimator takes with all that it starts is counted, by the kernel or by its server."""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import sys
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from simnav.leaderboard.campaign.campaign import CampaignError, run_campaign
from simnav.leaderboard.campaign.confinement import landlock, privileges, seccomp
from simnav.leaderboard.campaign.confinement.attempt import attempt
from simnav.leaderboard.campaign.confinement.memory_group import MemoryGroup
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what processes take")

_SCENARIO = Path(__file__).parents[2] / "hostile" / "cheats" / "scenario.toml"
_ROW = """
import os, tempfile, time
import numpy as np
from simnav import Estimate, Estimator

def fork(what):
    if os.fork() == 0:
        kept = what()
        time.sleep(600)

class Mine(Estimator):
    def reset(self, start, instruments):
        self.position = start.position

    def update(self, measurements):
        if abs(measurements.time - 3.0) < 1e-6:
            {update}
            time.sleep(20.0)
        return Estimate(measurements.time, position=self.position)
"""


@pytest.fixture(autouse=True)
def _registry(clean_registry: None) -> None:
    """Each test has a class ``Mine`` in a file of its own."""


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load(_SCENARIO), 0)


@pytest.fixture(scope="module", params=["counted by the kernel", "counted by the server"])
def server(request: pytest.FixtureRequest) -> Iterator[EstimatorServer]:
    made = EstimatorServer("process", loaded=())
    if "server" in request.param:
        made._group.close()
    elif made._group.joining < 0:
        made.close()
        pytest.skip("no control group can be made here")
    made.wait_until_ready()
    yield made
    made.close()


@pytest.mark.parametrize(
    "update",
    [
        "[fork(lambda: np.ones(5 << 20)) for _ in range(4)]",
        "fork(lambda: [fork(lambda: np.ones(5 << 20)) for _ in range(4)])",
        "self.files = [tempfile.TemporaryFile() for _ in range(4)]; "
        "[f.write(bytes(1 << 20)) for f in self.files for _ in range(40)]",
        "[open(os.path.join(tempfile.gettempdir(), str(k)), 'wb').write(bytes(40 << 20)) for k in range(4)]",
    ],
    ids=["children", "grandchildren", "deleted files", "files"],
)
def test_all_that_it_takes_counts(update: str, server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    """160 MiB, in parts of 40 MiB; each of them is allowed."""
    file = tmp_path / "mine.py"
    file.write_text(_ROW.format(update=update))
    made = attempt(server, Entrant(str(file), {}, "mine", False, ""), recording, Limits(15.0, 120 << 20))
    assert made.status == "out-of-memory", made.reason
    less = file.read_text().replace("range(4)", "range(2)").replace("20.0", "1.0")
    file.write_text(less)
    made = attempt(server, Entrant(str(file), {}, "less", False, ""), recording, Limits(15.0, 120 << 20))
    assert made.status == "ok", made.reason


def test_what_is_left_of_deep_folders_is_removed(server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    """What one leaves, the next would find."""
    file = tmp_path / "mine.py"
    update = """os.chdir(tempfile.gettempdir())
            os.mkdir("closed", 0o300)
            open("closed/file", "w").close()
            self.note = tempfile.gettempdir()
            for _ in range(1200):
                os.mkdir("d")
                os.chdir("d")
            return Estimate(measurements.time, position=self.position, diagnostics={self.note: 1.0})"""
    file.write_text(_ROW.replace("{update}", update))
    made = attempt(server, Entrant(str(file), {}, "mine", False, ""), recording, Limits(15.0, 120 << 20))
    assert made.trial is not None, made.reason
    assert not Path(next(iter(made.trial.diagnostics))).exists()


def test_a_group_counts_and_goes() -> None:
    group = MemoryGroup()
    if group.joining < 0:
        pytest.skip("no control group can be made here")
    folder = group._folder
    assert folder is not None
    try:
        assert group.limit(32 << 20)
        child = os.fork()
        if child == 0:
            os.write(group.joining, b"0")
            kept = bytearray(os.urandom(1 << 20)) * 200
            os._exit(len(kept) and 3)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -9
        assert group.kills() == 1
    finally:
        group.close()
    assert not folder.exists()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root has rights to give up")
def test_root_gives_up_all_but_to_read(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.write_text("x")
    closed.chmod(0)
    user = privileges.user_for(5)
    assert user != privileges.user_for(6)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            done = privileges.give_up(user)
            closed.read_text()
            try:
                closed.write_text("y")
            except PermissionError:
                code = 0 if done and os.geteuid() != 0 else 2
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert closed.stat().st_size == 1


def _forbid(numbers: Iterable[int]) -> None:
    """No system call with one of these numbers, in this process and all that it starts."""
    program = seccomp._instruction(0x20, 0)
    for number in numbers:
        program += seccomp._instruction(0x15, number, 0, 1) + seccomp._instruction(0x06, 0x00050001)
    program += seccomp._instruction(0x06, 0x7FFF0000)
    text = ctypes.create_string_buffer(program, len(program))
    given = ctypes.create_string_buffer(struct.pack("@HP", len(program) // 8, ctypes.addressof(text)))
    call = seccomp._CALL[platform.machine()]
    assert ctypes.CDLL(None).syscall(call, 1, 0, ctypes.c_void_p(ctypes.addressof(given))) == 0


def _campaign_without(*numbers: int, folder: Path) -> tuple[bool, str]:
    """Whether a campaign ended well that may not make some system calls, and its error or its warnings.

    It runs in a copy of this process, for a filter of system calls is for ever.
    """
    child = os.fork()
    if child == 0:
        code = 2
        try:
            _forbid(numbers)
            with warnings.catch_warnings(record=True) as given:
                warnings.simplefilter("always")
                code, said = 1, ""
                try:
                    run_campaign([load(_SCENARIO)], [EstimatorRequest("gnss-only")], [0], folder / "results",
                                 workers=1, confinement="process")  # fmt: skip
                    code = 0
                except CampaignError as error:
                    said = str(error)
            (folder / "said").write_text(said + "".join(f"{w.category.__name__}: {w.message}\n" for w in given))
        finally:
            os._exit(code)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return status == 0, (folder / "said").read_text()


@pytest.mark.skipif(not seccomp.available() or os.geteuid() != 0, reason="only root has rights to give up, on Linux")
@pytest.mark.parametrize(
    ("forbidden", "warns"),
    [(("capset", "setresuid"), True), (("setresuid",), False)],
)
def test_a_campaign_warns_where_rights_cannot_be_given_up(
    forbidden: tuple[str, ...], warns: bool, tmp_path: Path
) -> None:
    """By real attempts, under filters of system calls as containers have them."""
    arm = platform.machine() == "aarch64"
    numbers = {"capset": 91 if arm else 126, "setresuid": 147 if arm else 117}
    well, said = _campaign_without(*(numbers[name] for name in forbidden), folder=tmp_path)
    assert well, said
    assert ("PrivilegesWarning: estimators keep capabilities of root" in said) == warns, said


@pytest.mark.skipif(not seccomp.available(), reason="the system calls are not known here")
def test_nobody_runs_where_confinement_is_refused(tmp_path: Path) -> None:
    """The name of a confinement in a result is that of one that was in force."""
    arm = platform.machine() == "aarch64"
    for number, what in ((446, "Landlock"), (277 if arm else 317, "seccomp")):
        if what == "seccomp" or landlock.available():
            well, said = _campaign_without(number, folder=tmp_path)
            assert not well
            assert "cannot be confined" in said
            assert what in said
