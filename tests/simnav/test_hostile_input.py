"""Input that nobody means well: one short message with file and key, and nothing is allocated."""

from __future__ import annotations

import functools
import os
import re
import subprocess
import sys
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from simnav.compiled import Kernel
from simnav.leaderboard.results.errors import sentence
from simnav.scenario import parse
from simnav.source import record
from simnav.spec import SpecError
from tests.cases import ship

TEXT = ship("a", 20.0)
INSTRUMENTS = "[instruments.gnss]\n"
ERRORS = "[initial_error]\n{}\n" + INSTRUMENTS

CASES = {
    "speed": ("speed_m_s = 5.0", "speed_m_s = 1e11", "start.speed_m_s = 1e+11: should be at most 1000"),
    "subnormal": ("[3.0, 3.0, 5.0]", "[1e-310, 3.0, 5.0]", "instruments.gnss.sigma = 1e-310"),
    "start": ("heading_deg = 45.0", "heading_deg = 1e-310", "start.heading = "),
    "underflow": (INSTRUMENTS, ERRORS.format("velocity_m_s = [1e-170, 1, 1]"), "initial_error.velocity_m_s = [1e-170"),
    "position": (INSTRUMENTS, ERRORS.format("position_m = [1, 1e-310, 1]"), "initial_error.position_m = [1, 1e-310"),
    "factor": (INSTRUMENTS, ERRORS.format("times_told.velocity = inf"), "initial_error.times_told.velocity = inf"),
    "large factor": (INSTRUMENTS, ERRORS.format("times_told.velocity = 1e300"), "should be at most 1e+06"),
    "truth value": (INSTRUMENTS, ERRORS.format("times_told.velocity = true"), "times_told.velocity = True should be a"),
    "number as text": (
        INSTRUMENTS,
        ERRORS.format("times_told.velocity = '3'"),
        "times_told.velocity = '3' should be a",
    ),
    "nested": ("speed_m_s = 5.0", f"speed_m_s = {'[' * 500}{']' * 500}", "speed_m_s"),
    "very nested": ("speed_m_s = 5.0", f"speed_m_s = {'[' * 5000}{']' * 5000}", "line 11, speed_m_s: lists or tables"),
    "digits": ("speed_m_s = 5.0", f"speed_m_s = {'9' * 5000}", "line 11, speed_m_s: a number has more digits"),
    "long text": ('kind = "hold"', f'kind = "{"x" * 10_000}"', "kind"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_scenario_is_refused_with_file_and_key(case: str) -> None:
    old, new, message = CASES[case]
    with pytest.raises(SpecError) as caught:
        parse(TEXT.replace(old, new), source="bad.toml")
    text = sentence(caught.value)
    assert "bad.toml" in text
    assert message in text
    assert len(text) <= 1000


def test_the_cost_of_a_recording_is_estimated_before_it_is_made() -> None:
    scenario = parse(TEXT.replace("20.0", "1e7").replace("rate_hz = 1.0", "rate_hz = 1e5"))
    tracemalloc.start()
    message = r"a-v1: a recording of duration_s = 1e\+07 with instruments.gnss.rate_hz = 100000 takes about .* GiB"
    with pytest.raises(SpecError, match=message):
        record(scenario, 0)
    assert tracemalloc.get_traced_memory()[1] < 10 << 20
    tracemalloc.stop()


def test_random_intervals_have_a_least_length() -> None:
    fault = '[[fault]]\nkind = "outage"\ninstruments = ["gnss"]\nmean_active_s = 1e-9\nmean_gap_s = 1e-9\n'
    with pytest.raises(SpecError, match=re.escape("mean_active_s = 1e-09: should be at least 0.001")):
        parse(TEXT + fault)


def twice(x: float) -> float:
    return 2.0 * x


def loaded_anew() -> Kernel[[float], float]:
    """As in another process: compiled, or loaded from the cache, when it is called."""
    return Kernel(twice, "f8(f8)", False)


def flipped(content: bytes, at: float) -> bytes:
    """The content with one bit wrong, at a part of its length."""
    place = int(at * (len(content) - 1))
    return content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "truncated": lambda content: content[:100],
    "longer": lambda content: content + b"0",
    "zeros": lambda content: bytes(len(content)),
    **{f"bit at {at:.0%}": functools.partial(flipped, at=at) for at in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)},
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_cache_is_compiled_again(
    damage: str, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    first = loaded_anew()
    assert first(2.0) == 4.0
    directory = first.directory()
    assert directory is not None
    (path,) = directory.glob(f"*/*.{suffix}")
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    with pytest.warns(UserWarning, match="the compiled kernel twice in .* is damaged .*; it is compiled again"):
        assert loaded_anew()(2.0) == 4.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert loaded_anew()(3.0) == 6.0  # and the cache is whole again


@pytest.mark.skipif(os.name != "posix", reason="a shell closes the stream")
def test_a_closed_stream_and_an_ascii_terminal_are_no_error() -> None:
    command = f"{sys.executable} -m simnav --version"
    assert subprocess.run(f"{command} >&-", shell=True, check=False).returncode == 0
    assert subprocess.run(f"{command} 2>&- <&-", shell=True, check=False, stdout=subprocess.DEVNULL).returncode == 0
    listed = f"PYTHONIOENCODING=ascii LC_ALL=C {sys.executable} -m simnav list scenarios"
    assert subprocess.run(listed, shell=True, check=False, stdout=subprocess.DEVNULL).returncode == 0


def test_an_empty_name_is_no_wish_for_everything() -> None:
    from simnav.leaderboard.campaign.request import requests
    from simnav.leaderboard.results.errors import RequestError

    for empty in ("", " , "):
        with pytest.raises(RequestError, match="names no estimator; leave the option out for all of them"):
            requests([empty])
