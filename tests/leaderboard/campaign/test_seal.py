"""Sealed seeds: secret before the key is published, repeated to the bit afterwards; and plans of any length."""

from __future__ import annotations

import json
import os
import random
import tracemalloc
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.plan import Plan
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.rescoring import rescore_results
from simnav.leaderboard.campaign.seal import Seal, read_seal
from simnav.leaderboard.campaign.verification import verify_results
from simnav.leaderboard.campaign.worker import Unit
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import load
from simnav.warmup import warmup

pytestmark = pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "key"
    path.write_text("8f3c5a0e7d19b264c1f07ae9365bd482\n")
    path.chmod(0o600)
    return path


@pytest.fixture(autouse=True)
def _unconfined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seals do not depend on confinement, and its process takes a second to start for each folder."""
    monkeypatch.setenv("SIMNAV_CONFINEMENT", "none")


def test_a_sealed_campaign_is_repeated_by_whoever_has_the_key(tmp_path: Path, key: Path) -> None:
    warmup(load=False)
    scenario = load("harbour-multipath").model_copy(update={"duration": 20.0})
    request, out = EstimatorRequest("gnss-only"), tmp_path / "out"
    seal = read_seal(key)
    run_campaign([scenario], [request], range(2), out, workers=1, seal=seal, keep_trials=True)
    run_campaign([scenario], [request], range(2), tmp_path / "public", workers=1)
    found = store.load(out)
    assert [r.seed for r in found] == [0, 1]
    assert {r.provenance.seal for r in found} == {seal.hash}
    public = store.load(tmp_path / "public")
    assert {r.key for r in found}.isdisjoint({r.key for r in public})
    assert [r.scores["horizontal_rmse"] for r in found] != [r.scores["horizontal_rmse"] for r in public]
    everything = b"".join(p.read_bytes() for p in out.rglob("*") if p.is_file())
    secrets = [key.read_bytes().strip(), seal.key, seal.key.hex().encode()]
    secrets += [str(seal.seed(scenario.id, n)).encode() for n in range(2)]
    assert not any(secret in everything for secret in secrets)

    good = verify_results(out, seal, scenarios=[scenario])
    assert good.passed
    assert (good.repeated, good.different, good.not_repeatable) == (2, (), ())
    assert verify_results(tmp_path / "public", scenarios=[scenario], sample=1).passed
    other = verify_results(out, Seal(bytes(32)), scenarios=[scenario])
    assert (other.passed, other.other_seals, other.repeated) == (False, 2, 0)

    before = {r.key: r.scores["horizontal_rmse"] for r in found}
    assert rescore_results(out, ["horizontal_rmse"], [scenario], seal=seal).rescored == 2
    assert {r.key: r.scores["horizontal_rmse"] for r in store.load(out)} == pytest.approx(before, rel=1e-6)
    with pytest.raises(RequestError, match="the seeds of these results are sealed; give the key, with --key KEYFILE"):
        rescore_results(out, scenarios=[scenario])
    with pytest.raises(RequestError, match=f"and the results carry {seal.hash}: it is another key"):
        rescore_results(out, scenarios=[scenario], seal=Seal(bytes(32)))


def test_a_changed_score_is_found(tmp_path: Path, key: Path) -> None:
    scenario = load("harbour-multipath").model_copy(update={"duration": 20.0})
    run_campaign([scenario], [EstimatorRequest("gnss-only")], [3], tmp_path / "out", workers=1, seal=read_seal(key))
    (result,) = store.load(tmp_path / "out")
    store.rescore(tmp_path / "out", {result.key: {**result.scores, "horizontal_rmse": 0.1}}, result.scoring)
    report = verify_results(tmp_path / "out", read_seal(key), scenarios=[scenario])
    assert (report.passed, len(report.different)) == (False, 1)
    assert "horizontal_rmse 0.1 is stored, " in report.different[0]
    assert simnav.verify(tmp_path / "out", key=key).to_dict()["not_repeatable"]  # the catalogue's is longer


def test_a_key_is_a_secret_and_stays_one(tmp_path: Path, key: Path) -> None:
    seal = read_seal(key)
    assert seal.hash not in str(seal.seed("a-v1", 0))
    assert seal.key.hex() not in repr(seal)
    seeds = {seal.seed(name, n) for name in ("a-v1", "b-v1") for n in range(50)}
    assert len(seeds) == 100
    assert all(0 <= s < 2**63 for s in seeds)
    assert read_seal(key).seed("a-v1", 7) == seal.seed("a-v1", 7)
    with pytest.raises(RequestError, match=r"absent cannot be read: No such file .*; 'simnav campaign seal .*' makes"):
        read_seal(tmp_path / "absent")
    (tmp_path / "short").write_text("secret")
    with pytest.raises(RequestError, match="holds 6 bytes; a key has 16 to 4096"):
        read_seal(tmp_path / "short")
    key.chmod(0o644)
    with pytest.raises(RequestError, match=r"can be read by others \(mode 644\); 'chmod 600"):
        read_seal(key)
    assert read_seal(key, secret=False).key == seal.key  # once it is published, it need not be a secret


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("0123456789abcdef0123456789abcdef", "worth 6 bits at most"),
        ("deadbeef" * 8, "worth 17 bits at most"),
        ("1" * 64, "worth 0 bits at most"),
        ("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", "bits at most"),
        ("password1234567890Password", "bits at most"),
        ("the sealed campaign of the Society of Navigation in the year 2026", "holds words"),
        ("thequickbrownfoxjumpsoverthelazydogthequick", "holds words"),
    ],
)
def test_a_key_that_can_be_guessed_is_refused(tmp_path: Path, words: str, said: str) -> None:
    (tmp_path / "key").write_text(words)
    (tmp_path / "key").chmod(0o600)
    with pytest.raises(RequestError, match=said):
        read_seal(tmp_path / "key")


def test_random_keys_of_all_usual_forms_are_taken(tmp_path: Path) -> None:
    draw = random.Random(1)
    for k in range(50):
        drawn = draw.randbytes(32)
        for words in (drawn.hex().encode(), drawn[:16].hex().encode(), b"\x01" + drawn + b"\x01"):
            file = tmp_path / f"key-{k}-{len(words)}"
            file.write_bytes(words)
            file.chmod(0o600)
            assert read_seal(file).secret


def test_the_commitment_is_known_before_a_public_value_is_mixed_in(tmp_path: Path) -> None:
    file = tmp_path / "key"
    made = CliRunner().invoke(app, ["campaign", "seal", str(file), "--json"])
    assert made.exit_code == 0, made.output
    before = json.loads(made.stdout)
    assert file.stat().st_mode & 0o777 == 0o600
    assert before["commitment"] == before["seal"] == read_seal(file).hash
    assert file.read_text().strip() not in made.stdout
    first = [read_seal(file).seed("a-v1", n) for n in range(5)]
    after = json.loads(CliRunner().invoke(app, ["campaign", "seal", str(file), "--public", "7 12 33", "--json"]).stdout)
    mixed = read_seal(file)
    assert after["commitment"] == before["commitment"] == mixed.commitment
    assert after["seal"] == mixed.hash != mixed.commitment
    assert mixed.public == "7 12 33"
    assert not set(first) & {mixed.seed("a-v1", n) for n in range(5)}
    assert file.stat().st_mode & 0o777 == 0o600
    again = CliRunner().invoke(app, ["campaign", "seal", str(file), "--public", "8 12 33"])
    assert again.exit_code == 2
    assert "has the public value '7 12 33' already" in " ".join(again.output.split())
    checked = CliRunner().invoke(app, ["campaign", "seal", str(file)])
    assert f"commitment: {mixed.commitment}" in checked.stdout


def test_a_thousand_million_runs_cost_no_memory() -> None:
    scenario = load("harbour-multipath")
    entrants = [Entrant(n, {}, n, False, n) for n in ("a", "b")]
    there = {"v-a-5", "v-a-7", "v-b-7"}
    plan = Plan([scenario], entrants, range(10**9), {scenario.id: {"a": "v-a", "b": "v-b"}}, there)
    assert plan.total == 2 * 10**9
    assert plan.weight == pytest.approx(scenario.duration * (2e9 - 3.0))
    made: Counter[str] = Counter()

    def unit(chosen: object, seed: int, missing: tuple[tuple[Entrant, str], ...]) -> Unit:
        made.update(key for _, key in missing)
        return missing  # type: ignore[return-value]

    tracemalloc.start()
    units = plan.units(unit)
    for _ in range(7):
        next(units)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()
    assert sum(made.values()) == 13  # of eight seeds: one is done, of another half
    assert not there & set(made)


def test_a_campaign_of_a_thousand_million_runs_begins_at_once(tmp_path: Path) -> None:
    class EnoughError(Exception):
        pass

    def stop(progress: object) -> None:
        if getattr(progress, "done", 0) and getattr(progress, "stage", "") == "run":
            raise EnoughError

    scenario = load("harbour-multipath").model_copy(update={"duration": 5.0})
    with pytest.raises(EnoughError):
        run_campaign([scenario], [EstimatorRequest("gnss-only")], range(10**9), tmp_path, workers=1, progress=stop)
    assert json.dumps([r.seed for r in store.load(tmp_path)])[:2] == "[0"
