"""The blind check: its generator against closed forms, its seals, its score, and all of it through the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stablepush import InputError, read_pushlog
from stablepush.blind.score import outcome, score_of, share
from stablepush.blind.seal import Ledger, complaint, digest, digest_of_folder, open_label
from stablepush.blind.worlds import CHANGING_FORMS, FORMS, Applied, draw, share_in_log
from stablepush.effects import CATALOGUE

pytest.importorskip("mujoco")
fernet = pytest.importorskip("cryptography.fernet")

from stablepush.blind import laws  # noqa: E402
from stablepush.blind.engine import Engine, contact_mu_under  # noqa: E402
from stablepush.blind.generator import engine_of  # noqa: E402
from stablepush.blind.instruments import record, write  # noqa: E402
from stablepush.blind.mujoco_engine import MujocoEngine  # noqa: E402


def run_cli(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "stablepush", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def said(*_: object) -> None:
    """Progress that nobody reads."""


def test_half_of_the_worlds_are_clean_and_every_effect_comes_in_every_form() -> None:
    worlds = [draw(3, k, 4) for k in range(16 * 30)]
    assert sum(w.kind == "clean" for w in worlds) * 2 == len(worlds)
    found = {(a.effect, a.form) for w in worlds if w.kind == "effect" for a in w.applied}
    assert found == {(effect, form) for effect, forms in FORMS.items() for form in forms}
    assert all(not w.applied for w in worlds if w.kind in ("clean", "trap"))
    assert set(FORMS) <= set(CATALOGUE)


def test_the_number_of_a_set_does_not_tell_its_cause() -> None:
    kinds = [[(w.kind, [a.effect for a in w.applied]) for k in range(24) if (w := draw(seed, k, 4))] for seed in (1, 2)]
    # half of all sets are clean
    assert sum(one == other for one, other in zip(*kinds, strict=True)) < 16


@pytest.mark.parametrize("form", ["lobes", "grains", "ridges"])
def test_friction_over_direction_is_that_of_a_convex_set_of_forces(form: str) -> None:
    """The force of a direction does the most work in it: no other direction's force does more."""
    applied = Applied("anisotropy-world", form, {"ratio": 1.32, "direction": 0.4, "between": 0.8})
    world = replace(draw(1, 0, 4), applied=[applied])
    angles = np.linspace(-np.pi, np.pi, 361)
    velocity = 0.02 * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    force = laws.friction_at(world, np.zeros((361, 2)), velocity, 0.0, 0.0)
    work = velocity @ force.T
    assert (np.diag(work)[:, None] >= work - 1e-6 * world.mu * 0.02).all()
    assert np.ptp(np.diag(work)) > 0.1 * world.mu * 0.02


@pytest.mark.parametrize("form", sorted(CHANGING_FORMS))
def test_what_changes_over_the_log_is_as_large_in_the_mean(form: str) -> None:
    shares = np.array([share_in_log(form, order) for order in np.linspace(0, 1, 1000)])
    assert shares.mean() == pytest.approx(1.0, abs=0.03)
    assert np.ptp(shares) >= 0.7


def test_worlds_come_from_their_seed() -> None:
    one, same, other = draw(3, 5, 6), draw(3, 5, 6), draw(4, 5, 6)
    assert np.array_equal(one.outline, same.outline) and one.applied == same.applied
    assert not np.array_equal(one.weights, other.weights)


def engine_for(generator: str) -> type[Engine]:
    if generator == "drake":
        pytest.importorskip("pydrake", reason="needs the extra drake")
    return engine_of(generator, 0, 0)


@pytest.mark.parametrize("generator", ["mujoco", "drake"])
@pytest.mark.parametrize(
    "form",
    [
        None,
        ("anisotropy-world", "ellipse"),
        ("anisotropy-object", "lobes"),
        ("tilt", "dome"),
        ("spatial-variation", "stain"),
        ("anisotropy-world", "ridges"),
        ("speed-dependence", "valley"),
        ("pressure-shift", "nudge"),
    ],
)
def test_the_load_is_coulomb_s(form: tuple[str, str] | None, generator: str) -> None:
    """Means over parts of pushes against the sum over the feet: within a percent of the load, away from turns about a foot."""
    number = next(
        k
        for k in range(16 * 60)
        if (w := draw(1, k, 4)).kind == ("effect" if form else "clean")
        and (form is None or (w.applied[0].effect, w.applied[0].form) == form)
    )
    world = draw(1, number, 8)
    engine, errors = engine_for(generator)(world), []
    for push in world.pushes:
        truth = engine.push(push, 0.0)
        force = np.einsum("nji,nj->ni", laws.turned(truth.pose[:, 2]), truth.force[:, :2])
        loads, _ = laws.loads(world, truth.pose, truth.twist, np.zeros(len(truth.pose)))
        errors.append(np.abs(force - loads[:, :2]).max(axis=1))
    assert np.median(np.concatenate(errors)) < 0.012 * world.mu * world.mass * 9.81


@pytest.mark.parametrize("generator", ["mujoco", "drake"])
def test_a_finger_that_sticks_does_not_creep(generator: str) -> None:
    world = next(w for k in range(50) if not (w := draw(1, k, 8)).two and w.kind == "clean")
    engine, slips = engine_for(generator)(world), []
    for push in world.pushes:
        truth = engine.push(push, 0.0)
        inward = np.array((np.cos(push.place[2]), np.sin(push.place[2])))
        along = np.array((-inward[1], inward[0]))
        turn = laws.turned(truth.pose[:, 2])
        force = np.einsum("nji,nj->ni", turn, truth.force[:, :2])
        place = np.einsum("nji,nj->ni", turn, truth.pusher[:, :2] - truth.pose[:, :2])
        rolled = world.radius * np.diff(truth.pusher[:, 2] - truth.pose[:, 2])
        slip = np.abs(np.diff(place @ along) + rolled) / np.diff(truth.time) / push.speed
        sticks = np.abs(force @ along) < 0.7 * world.contact_mu * (force @ inward)
        slips.append(slip[sticks[1:] & sticks[:-1]])
    assert np.median(np.concatenate(slips)) < 0.03


def recorded(folder: Path, *applied: Applied) -> dict[str, np.ndarray]:
    """Samples of a world's pushes without noise, with effects of the instruments or without."""
    world = replace(
        draw(1, 0, 4), applied=list(applied), force_noise=1e-9, position_noise=1e-9, angle_noise=1e-9, tracker=True, trap=""
    )
    truths = [MujocoEngine(replace(world, applied=[])).push(push, 0.0) for push in world.pushes]
    write(folder, *record(world, truths, np.random.default_rng(0)))
    samples = read_pushlog(folder).samples
    push = samples["phase"] == "push"
    return {name: np.asarray(samples[name][push], dtype=float) for name in ("t", "x", "y", "theta", "fx", "fy", "tau", "vx")}


def in_world(samples: dict[str, np.ndarray]) -> np.ndarray:
    force = np.stack((samples["fx"], samples["fy"]), axis=-1)
    return np.einsum("nij,nj->ni", laws.turned(samples["theta"]), force)


def test_instruments_err_as_the_contract_has_it(tmp_path: Path) -> None:
    """Bias in W, rotation counter-clockwise, tracked origin minus the centre of mass in B, poses that lag."""
    plain = recorded(tmp_path / "plain")
    biased = recorded(tmp_path / "bias", Applied("force-bias", "constant", {"force": [0.3, -0.1]}))
    assert np.allclose(in_world(biased) - in_world(plain), (0.3, -0.1), atol=2e-3)
    turned = recorded(tmp_path / "rotation", Applied("force-rotation", "angle", {"angle": 0.1}))
    assert np.allclose(in_world(turned), in_world(plain) @ laws.turned(0.1).T, atol=5e-3)
    offset = recorded(tmp_path / "frame", Applied("frame-offset", "constant", {"offset": [0.004, 0.001]}))
    moved = np.stack((offset["x"] - plain["x"], offset["y"] - plain["y"]), axis=-1)
    assert np.allclose(np.einsum("nji,nj->ni", laws.turned(plain["theta"]), moved), (0.004, 0.001), atol=1e-6)
    # the moment is about the tracked origin
    assert np.allclose(offset["tau"] - plain["tau"], -0.004 * plain["fy"] + 0.001 * plain["fx"], atol=2e-3)
    late = recorded(tmp_path / "latency", Applied("latency", "delay", {"delay": 0.05}))
    lag = np.hypot(late["x"] - plain["x"], late["y"] - plain["y"])
    forward = np.flatnonzero(np.diff(plain["t"]) > 0)
    speed = np.hypot(np.diff(plain["x"]), np.diff(plain["y"]))[forward] / np.diff(plain["t"])[forward]
    assert np.median(lag[forward + 1] / speed) == pytest.approx(0.05, rel=0.15)


def test_logs_are_read_as_logs(tmp_path: Path) -> None:
    from stablepush.blind.generator import generate

    number = next(k for k in range(50) if draw(7, k, 4).kind == "effect")
    label, log = generate("mujoco", 7, number, 5)
    write(tmp_path, *log)
    read = read_pushlog(tmp_path)
    assert len(read) == 5 and label["applied"][0]["effect"] in FORMS and label["applied"][0]["size"] >= 0
    assert {"rest", "push"} == set(read.samples["phase"])


def sealed_set(folder: Path) -> tuple[Ledger, bytes, bytes, bytes, Path]:
    """A ledger with one set that is sealed and diagnosed."""
    key = fernet.Fernet.generate_key()
    token = fernet.Fernet(key).encrypt(json.dumps({"kind": "clean", "applied": []}).encode())
    log = folder / "log"
    log.mkdir()
    (log / "rig.json").write_text("{}", encoding="utf-8")
    ledger = Ledger(folder / "ledger.jsonl")
    ledger.add("sealed", 0, label=digest(token), log=digest_of_folder(log))
    answer = b'{"verdict": "none"}'
    ledger.add("diagnosed", 0, diagnosis=digest(answer))
    return ledger, key, token, answer, log


def test_a_whole_seal_opens(tmp_path: Path) -> None:
    ledger, key, token, answer, log = sealed_set(tmp_path)
    assert complaint(ledger, 0, token, log, answer) is None
    assert open_label(ledger, 0, token, key)["kind"] == "clean"
    assert complaint(Ledger(tmp_path / "ledger.jsonl"), 0, token, log, answer) is None


def test_a_label_that_was_changed_is_noticed(tmp_path: Path) -> None:
    ledger, key, token, answer, log = sealed_set(tmp_path)
    other = fernet.Fernet(key).encrypt(b'{"kind": "effect", "applied": []}')
    assert "sealed label" in str(complaint(ledger, 0, other, log, answer))
    with pytest.raises(InputError, match="changed"):
        open_label(ledger, 0, token[:-4] + b"AAAA", key)


def test_a_label_that_was_peeked_at_is_noticed(tmp_path: Path) -> None:
    ledger, key, token, answer, log = sealed_set(tmp_path)
    open_label(ledger, 0, token, key)
    # a diagnosis made again with the label in view
    significantly_better = b'{"verdict": "named"}'
    assert "the diagnosis is not the one" in str(complaint(ledger, 0, token, log, significantly_better))
    ledger.add("diagnosed", 0, diagnosis=digest(significantly_better))
    assert complaint(ledger, 0, token, log, significantly_better) is not None
    early = Ledger(tmp_path / "early.jsonl")
    early.add("sealed", 0, label=digest(token), log=digest_of_folder(log))
    open_label(early, 0, token, key)
    early.add("diagnosed", 0, diagnosis=digest(answer))
    assert "opened before" in str(complaint(early, 0, token, log, answer))


def test_a_log_that_was_changed_is_noticed(tmp_path: Path) -> None:
    ledger, _, token, answer, log = sealed_set(tmp_path)
    (log / "rig.json").write_text('{"mass": 2}', encoding="utf-8")
    assert "the log is not" in str(complaint(ledger, 0, token, log, answer))


@pytest.mark.parametrize("harm", ["change", "leave out", "swap"])
def test_a_ledger_that_was_changed_is_noticed(tmp_path: Path, harm: str) -> None:
    sealed_set(tmp_path)
    file = tmp_path / "ledger.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines()
    if harm == "change":
        lines[0] = lines[0].replace('"set": 0', '"set": 1')
    elif harm == "leave out":
        lines = lines[1:]
    else:
        lines = lines[::-1]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d: the chain is broken"):
        Ledger(file)


def test_a_line_that_was_cut_off_counts_for_nothing(tmp_path: Path) -> None:
    ledger = sealed_set(tmp_path)[0]
    with ledger.file.open("a", encoding="utf-8") as out:
        out.write('{"event": "opened", "se')
    assert len(Ledger(ledger.file).entries) == 2
    assert len(Ledger(ledger.file).entries) == 2


def row(kind: str, truth: list[str], verdict: str, said: list[str], detectable: bool = True) -> dict:
    common = {"form": "linear", "matches": True, "detectable": detectable, "size": 20.0, "parameters": {}, "nominal": 0.0}
    applied = [{"effect": effect, **common} for effect in truth]
    order = sorted(CATALOGUE, key=lambda effect: effect not in said)
    ranking = [{"effect": e, "probability": 0.9 if e in said else 0.01, "parameters": {}} for e in order]
    label = {"kind": kind, "trap": "", "contacts": "one", "engine": "mujoco", "friction_off": 0.0, "applied": applied}
    answer = {"verdict": verdict, "effects": said, "ranking": ranking, "shrink": [], "where": [], "seconds": 1.0}
    return {"set": 0, "label": label, "answer": answer, "known": {}}


def test_outcomes() -> None:
    assert outcome(row("clean", [], "none", [])) == "quiet"
    assert outcome(row("clean", [], "unknown", [])) == "unknown"
    assert outcome(row("clean", [], "named", ["drift"])) == "wrong name"
    assert outcome(row("effect", ["drift"], "named", ["drift"])) == "right"
    assert outcome(row("effect", ["drift"], "named", ["tilt"])) == "wrong name"
    assert outcome(row("effect", ["drift"], "named", ["drift", "tilt"])) == "right and more"
    assert outcome(row("effect", ["drift"], "ambiguous", ["drift", "tilt"])) == "in the set"
    assert outcome(row("effect", ["drift"], "absorbed", [])) == "missed"
    assert outcome(row("pair", ["drift", "tilt"], "named", ["tilt"])) == "one of two"
    assert outcome(row("outside", ["checkerboard"], "unknown", [])) == "unknown"
    assert outcome(row("outside", ["checkerboard"], "named", ["drift"])) == "wrong name"


def test_the_score_counts() -> None:
    rows = [
        row("clean", [], "none", []), row("clean", [], "named", ["tilt"]), row("effect", ["drift"], "named", ["drift"]),
        row("effect", ["drift"], "none", []), row("effect", ["drift"], "none", [], detectable=False),
        row("pair", ["drift", "tilt"], "named", ["drift", "tilt"]), row("outside", ["checkerboard"], "named", ["drift"]),
        row("pair", ["drift", "tilt"], "ambiguous", ["drift", "tilt"]),
    ]  # fmt: skip
    lines = dict(score_of(rows, {9: "why"}, 1, 1, "f" * 64).lines)
    assert lines["false alarms, clean sets"].startswith("1 of 2")
    assert lines["named, and nothing else, of detectable effects"].startswith("1 of 2")
    assert lines["wrong names, all sets but those out of the catalogue"].startswith("1 of 7")
    assert lines["pairs: both named"].startswith("1 of 2")
    assert lines["out of the catalogue: named as an effect of it"].startswith("1 of 1")
    assert "refused" in lines["sets"]
    assert share(0, 100) == "0 of 100, 0.0 % (0.0 to 3.6 %)" and share(0, 0) == "none to judge"


@pytest.mark.parametrize("stop", ["sealing", "between file and entry", "diagnosing", "scoring"])
def test_a_check_that_was_ended_goes_on_with_the_same_result(tmp_path: Path, stop: str, whole: list[dict]) -> None:
    from stablepush.blind.check import BlindCheck

    class Ended(BaseException):
        pass

    def end(*_: object) -> None:
        raise Ended

    begun = BlindCheck(tmp_path / "check", "mujoco", 2, seed=11, pushes=5)
    with pytest.raises(Ended):
        begun.seal(end if stop == "sealing" else said)
        if stop == "between file and entry":
            (begun.of(1) / "diagnosis.json").write_text("{}", encoding="utf-8")
            raise Ended
        begun.diagnose(end if stop == "diagnosing" else said)
        begun.score(said)
        raise Ended
    again = BlindCheck(tmp_path / "check")
    assert again.generator == "mujoco"
    again.seal(said)
    again.diagnose(said)
    score = again.score(said)
    assert not score.refused
    # to the last digit: what differs between processors does not between processes of one, and no sum depends on threads
    assert [{**r, "seconds": 0} for r in score.rows] == whole


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    """Rows of a check that was never ended, from the command line."""
    from stablepush.blind.check import BlindCheck

    folder = tmp_path_factory.mktemp("whole")
    answer = run_cli("blind", "--sets", "2", "--pushes", "5", "--seed", "11", "--jobs", "2", "-o", folder)
    assert answer.returncode == 0, answer.stderr
    heads = [line.split()[-1] for line in answer.stdout.splitlines() if line.startswith("ledger when")]
    again = run_cli("blind", "-o", folder, "--expect", heads[0], "--expect", heads[1])
    assert again.stdout == answer.stdout and len(heads) == 2
    assert "Blind check" in (folder / "score.html").read_text(encoding="utf-8")
    other = run_cli("blind", "--seed", "12", "-o", folder)
    assert other.returncode == 2 and "begun with seed 11" in other.stderr
    rows = BlindCheck(folder).score(said).rows
    # what was noted is missed when the end is cut off, though the chain that is left is whole
    ledger = folder / "ledger.jsonl"
    lines = ledger.read_text(encoding="utf-8").splitlines(keepends=True)
    ledger.write_text("".join(lines[:3]), encoding="utf-8")
    cut = run_cli("blind", "-o", folder, "--expect", heads[1])
    assert cut.returncode == 2 and "cut off" in cut.stderr
    return [{**r, "seconds": 0} for r in rows]


def test_a_set_whose_seal_is_broken_is_refused(tmp_path: Path) -> None:
    from stablepush.blind.check import BlindCheck

    check = BlindCheck(tmp_path / "check", "mujoco", 2, seed=3, pushes=4)
    check.seal(said)
    check.diagnose(said)
    (check.of(0) / "diagnosis.json").write_text("{}", encoding="utf-8")
    (check.of(1) / "label.sealed").unlink()
    answer = run_cli("blind", "-o", tmp_path / "check")
    assert answer.returncode == 1 and "set 0 refused: the diagnosis is not the one" in answer.stdout
    assert "set 1 refused" in answer.stdout


def test_the_diagnosing_process_gets_the_log_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stablepush.blind import check as module

    seen: dict[str, object] = {}
    run = module.run_child

    def spy(name: str, arguments: list[str], line: str = "", folder: Path | None = None) -> tuple[int, str]:
        if name.endswith("diagnoser"):
            assert folder is not None
            seen["files"] = sorted(f.relative_to(folder).as_posix() for f in folder.rglob("*") if f.is_file())
            seen["command"], seen["input"] = arguments, line
        return run(name, arguments, line, folder)

    monkeypatch.setattr(module, "run_child", spy)
    check = module.BlindCheck(tmp_path / "check", "mujoco", 1, seed=3, pushes=4)
    check.seal(said)
    check.diagnose(said)
    assert seen["files"] == ["log/rig.json", "log/samples.csv", "log/trials.csv"]
    assert seen["command"] == ["log", "answer.json"] and seen["input"] == ""


def test_a_diagnosis_that_breaks_down_is_an_answer(tmp_path: Path) -> None:
    from stablepush.blind.check import diagnosed

    number, answer = diagnosed(4, {"rig.json": b"{}"})
    assert number == 4 and json.loads(answer)["verdict"] == "failed"


@pytest.mark.parametrize("harm", ["key", "foreign", "garbage", "no begin"])
def test_folders_that_are_no_check(tmp_path: Path, harm: str) -> None:
    from stablepush.blind.check import BlindCheck

    folder = tmp_path / "check"
    folder.mkdir()
    if harm == "foreign":
        (folder / "thesis.tex").write_text("precious", encoding="utf-8")
    elif harm == "garbage":
        (folder / "ledger.jsonl").write_bytes(b"\xff\x00")
    elif harm == "no begin":
        Ledger(folder / "ledger.jsonl").add("sealed", 0, label="", log="")
    else:
        BlindCheck(folder, "mujoco", 1, seed=1, pushes=4)
        (folder / "key").unlink()
    before = sorted((f.name, f.read_bytes()) for f in folder.iterdir())
    answer = run_cli("blind", "-o", folder)
    assert answer.returncode == 2 and len(answer.stderr.splitlines()) == 1, answer.stderr
    assert sorted((f.name, f.read_bytes()) for f in folder.iterdir() if f.name != "lock") == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--generator", "chaos"), "chaos"),
        (("--sets", "0"), "--sets"),
        (("--pushes", "2"), "--pushes"),
        (("--jobs", "-1"), "--jobs"),
    ],
)
def test_bad_arguments_of_the_command(tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    answer = run_cli("blind", *arguments, "-o", tmp_path / "check")
    assert answer.returncode == 2 and words in answer.stderr and len(answer.stderr.splitlines()) == 1
    assert not (tmp_path / "check").exists()


def test_a_local_dask_cluster_gives_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("dask.distributed")
    from stablepush.blind.check import BlindCheck

    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        there = BlindCheck(tmp_path / "there", "mujoco", 2, seed=11, pushes=5, scheduler=cluster.scheduler_address)
        there.seal(said)
        there.diagnose(said)
    here = BlindCheck(tmp_path / "here", "mujoco", 2, seed=11, pushes=5)
    here.seal(said)
    here.diagnose(said)
    for number in range(2):
        one, other = (json.loads((c.of(number) / "diagnosis.json").read_text(encoding="utf-8")) for c in (there, here))
        # to the last digit, on one processor: logs and fits are too small for BLAS to share them out between threads
        assert {**one, "seconds": 0} == {**other, "seconds": 0}
        assert digest_of_folder(there.of(number) / "log") == digest_of_folder(here.of(number) / "log")


def test_the_lab_s_cases_do_not_tell_their_arrangement(lab: Path) -> None:
    from stablepush.blind.supports import cases, imported
    from stablepush.io.importers.mlab import triangle_slider

    key = fernet.Fernet.generate_key()
    number = next(i for i, (source, arrangement) in enumerate(cases(lab)) if source.labels["arrangement"] != arrangement)
    source, arrangement = cases(lab)[number]
    _, files = imported(number, lab, key)
    text = b"".join(data for name, data in files.items() if name.startswith("log/"))
    assert source.labels["arrangement"].encode() not in text and source.name.encode() not in text
    label = json.loads(fernet.Fernet(key).decrypt(files["label.sealed"]))
    assert (label["arrangement"], label["nominal"], len(label["applied"])) == (source.labels["arrangement"], arrangement, 1)
    rig = json.loads(files["log/rig.json"])
    support = triangle_slider(arrangement).support
    assert support is not None and np.allclose(rig["slider"]["support"]["points"], support.points)


def test_the_score_of_supports_counts() -> None:
    from stablepush.blind.supports import score_of_supports

    def case(wrong: bool, verdict: str, said: list[str], after: float) -> dict:
        shrink = [{"channel": "wrench", "before": 1.0, "after": after, "closed": 1 - after**2}]
        label = {"surface": "wood", "arrangement": "a", "nominal": "b" if wrong else "a", "applied": [1] if wrong else []}
        return {"set": 0, "label": label, "answer": {"verdict": verdict, "effects": said, "shrink": shrink}}

    rows = [
        case(True, "named", ["pressure-shift"], 0.1), case(True, "absorbed", [], 0.2), case(True, "named", ["tilt"], 0.9),
        case(True, "unknown", [], 1.2), case(False, "none", [], 1.0), case(False, "named", ["drift"], 0.9),
    ]  # fmt: skip
    lines = dict(score_of_supports(rows, {}, 1, "").lines)
    assert lines["wrong support: the pressure named, or explained by recalibration"].startswith("2 of 4")
    assert lines["wrong support: another cause named"].startswith("1 of 4")
    assert lines["wrong support: the corrected wrench is closer"].startswith("3 of 4")
    assert lines["right support: no cause named"].startswith("1 of 2")


@pytest.mark.parametrize("form", FORMS["contact-friction"])
def test_friction_of_the_fingers_is_positive_in_every_world(form):
    """Also where a change is larger than the friction that it takes from."""
    world = replace(draw(0, 3, 10), contact_mu=0.1, applied=[Applied("contact-friction", form, {"change": -0.3})])
    for order in (0.0, 0.5, 1.0):
        assert (contact_mu_under(laws.at(world, order), np.array([[0.0, 0.0], [3.0, 0.0]])) > 0).all()
