"""Submissions: what is sound is taken, and every way to cheat that we could think of is caught or stopped, and said."""

from __future__ import annotations

import json
import shutil
import stat
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tiny

from dextron_bench import cli, recording, records, splits
from dextron_bench.isolation.agent import Limits
from dextron_bench.submission import bundle, contest, merging, verification
from dextron_bench.submission.verification import Verdict
from dextron_bench.world import sources

AGENT = """
import numpy as np
from dextron_bench.world import task


class Near:
    name = "near"

    def __init__(self, near=0.06):
        self.near = near

    def agent(self, seed):
        return self

    def reset(self, episodes):
        pass

    def act(self, states):
        return np.where(task.distance(states) <= self.near, 1.0, -1.0)[:, None]
"""
ROWS = pd.concat([tiny.ROWS, pd.DataFrame([("test", *tiny.FALLS)], columns=tiny.COLUMNS)], ignore_index=True)


@dataclass
class Forgery:
    """A submission taken apart, to be changed and put together again with hashes that are right."""

    folder: Path
    board: Path

    @property
    def seed(self) -> Path:
        return self.folder / "seed0"

    def table(self, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
        """Changes the table of episodes."""
        records.store(self.seed, change(pd.read_parquet(self.seed / records.EPISODES)))

    def json(self, name: str, change: Callable[[dict[str, Any]], object]) -> None:
        """Changes a JSON file."""
        value = json.loads((self.folder / name).read_text())
        change(value)
        (self.folder / name).write_text(json.dumps(value))

    def conclude(self) -> None:
        """Makes the result that of the changed episodes."""
        told = pd.read_parquet(self.seed / records.EPISODES)
        self.json("seed0/result.json", lambda result: result.update(splits=records.scores(told)))

    def checked(self, **how: Any) -> Verdict:
        """What verification finds after all hashes were made right."""
        manifest = json.loads((self.folder / bundle.MANIFEST).read_text())
        names = {str(each.relative_to(self.folder)): each for each in self.folder.rglob("*") if each.is_file()}
        hashes = {name: bundle.sha256(each) for name, each in names.items() if name != bundle.MANIFEST}
        file = self.folder.with_suffix(".zip")
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr(bundle.MANIFEST, json.dumps(manifest | {"files": hashes}))
            for name in hashes:
                archive.write(names[name], name)
        into = self.folder.with_name("again")
        shutil.rmtree(into, ignore_errors=True)
        return verification.verify(into, bundle.unpack(file, into), self.board, threads=1, **how)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A sound bundle of two seeds on a tiny benchmark, beside the folder of runs that it was made from."""
    here = tmp_path_factory.mktemp("submission")
    try:
        with pytest.MonkeyPatch.context() as patch:
            tiny.write(here / "splits", ROWS)
            tiny.install(here / "splits", patch.setattr)
            (here / "near.py").write_text(AGENT)
            entry = contest.Entry("near", f"{here}/near.py:Near", tiny.NAME, (0, 1))
            folder = contest.compete(entry, here / "runs", 1, Limits(start=300.0, answer=100.0), threads=1)
            contest.finish(entry, folder, here / "near.zip")
            yield here
    finally:
        tiny.forget()


@pytest.fixture
def forged(made: Path, tmp_path: Path) -> Forgery:
    folder = tmp_path / "forged"
    bundle.unpack(made / "near.zip", folder)
    with zipfile.ZipFile(made / "near.zip") as archive:
        (folder / bundle.MANIFEST).write_bytes(archive.read(bundle.MANIFEST))
    return Forgery(folder, tmp_path / "board")


def test_a_sound_submission_is_replayed_bit_for_bit_and_its_agent_run_again(forged: Forgery):
    """Of four episodes a seed one knocks the bottle over."""
    verdict = forged.checked(rerun=True)
    assert verdict.problems == []
    assert verdict.notes[-1] == "all seeds have the same episodes: they count as one, not as several trainings"
    assert (verdict.tier, verdict.episodes, verdict.exact) == ("re-run", 8, 8)
    assert verdict.results[0]["splits"]["test"]["scores"] == [20.0, 20.0, 0.0]


def test_equal_submissions_are_equal_bytes_and_nothing_is_played_twice(made: Path, tmp_path: Path):
    entry = contest.Entry("near", f"{made}/near.py:Near", tiny.NAME, (0, 1))

    def forbidden(*_: object) -> None:
        raise AssertionError("played again")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contest, "shuffled", forbidden)
        folder = contest.compete(entry, made / "runs", 1, Limits(), threads=1)
    contest.finish(entry, folder, tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == (made / "near.zip").read_bytes()


def test_episodes_are_played_in_an_order_that_depends_on_split_and_seed():
    split = splits.Split("test", "synthetic", tuple(splits.cases(tiny.ROWS)) * 20, "0" * 64)
    first, second = contest.order(split, 0), contest.order(split, 1)
    assert sorted(first) == list(range(len(split.cases)))
    assert list(first) != list(range(len(first)))
    assert list(first) != list(second)
    assert list(contest.order(replace(split, digest="1" * 64), 0)) != list(first)


def row(number: int, **changes: Any) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Changes one row of `test`."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        here = (table["split"] == "test") & (table["row"] == number)
        for name, value in changes.items():
            table[name] = [value if found else old for found, old in zip(here, table[name], strict=True)]
        return table

    return change


def test_a_changed_reward_is_caught(forged: Forgery):
    forged.table(row(2, score=20.0, success=True, cause="solved"))
    forged.conclude()
    assert "says success True; played again it is False" in forged.checked().problems[0]


def test_a_changed_action_is_caught(forged: Forgery):
    told = pd.read_parquet(forged.seed / records.EPISODES).query("split == 'test' and row == 0")
    actions = np.array(told["actions"].iloc[0])
    actions[-1] = np.nextafter(actions[-1], 0.0)
    forged.table(row(0, actions=actions))
    forged.conclude()
    assert "hash of states, actions and rewards is another" in "".join(forged.checked().problems)


def test_actions_that_are_none_or_too_few_are_caught(forged: Forgery):
    forged.table(row(0, actions=np.array([2.0])))
    assert "row 0 has actions that are not" in forged.checked().problems[0]
    forged.table(row(0, actions=np.zeros(3), length=3))
    forged.conclude()
    assert "played again it is" in "".join(forged.checked().problems)


def test_a_changed_state_is_caught_though_the_recording_is_hashed_again(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    told = recording.read(file)
    states = told.episode.states.copy()
    states[5, 2] += 1e-9
    source = sources.open_source(tiny.NAME)
    changed = replace(told.episode, states=states)
    recording.write(file, changed, source.path(changed.setting), told.properties)
    assert forged.checked().problems == ["seed0: recordings/test-0000.rrd is not of the episode that its actions give"]


def test_a_recording_under_another_name_is_caught(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    told = recording.read(file)
    path = sources.open_source(tiny.NAME).path(told.episode.setting)
    recording.write(file, told.episode, path, {**told.properties, "method": "other"})
    assert forged.checked().problems == ["seed0: recordings/test-0000.rrd says method other, not near"]
    file.rename(file.with_name("test-0001.rrd"))
    assert "test-0001.rrd is not of the episode" in forged.checked().problems[0]
    file.with_name("test-0001.rrd").rename(file.with_name("test-0900.rrd"))
    assert "test-0900.rrd is of no row of the splits" in forged.checked().problems[0]


def test_a_damaged_recording_is_caught(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    file.write_bytes(file.read_bytes()[:-100])
    assert "test-0000.rrd" in forged.checked().problems[0]


def test_a_changed_setting_is_caught(forged: Forgery):
    forged.table(row(2, offset_x=-0.015, offset_y=0.005))
    assert "test: row 2 was played in another setting than the split's" in forged.checked().problems[0]


def test_a_dropped_episode_is_caught(forged: Forgery):
    forged.table(lambda table: table[table["score"] > 0])
    forged.conclude()
    assert "has 3 episodes where the splits have 4" in forged.checked().problems[0]


def test_a_good_episode_twice_in_place_of_a_bad_one_is_caught(forged: Forgery):
    def twice(table: pd.DataFrame) -> pd.DataFrame:
        good = table[(table["split"] == "test") & (table["row"] == 0)]
        return pd.concat([table[table["score"] > 0], good], ignore_index=True)

    forged.table(twice)
    forged.conclude()
    problems = forged.checked().problems
    assert "test: row 0 is there 2 times" in problems[0]
    assert "test: row 2 is missing" in problems[1]
    forged.table(lambda table: table.assign(row=[0, 1, 0, 2]))
    assert "row 2 was played in another setting" in "".join(forged.checked().problems)


def test_swapped_splits_are_caught(forged: Forgery):
    names = {"test": "unseen-reach", "unseen-reach": "test"}
    forged.table(lambda table: table.assign(split=table["split"].map(names)))
    assert "was played on another version of the split" in forged.checked().problems[0]
    forged.table(lambda table: table.assign(split="train"))
    assert "train is none of the splits that rank methods" in forged.checked().problems[0]


def test_an_edited_result_is_caught(forged: Forgery):
    def better(result: dict[str, Any]) -> None:
        result["splits"]["test"]["scores"][2] = 20.0

    forged.json("seed0/result.json", better)
    assert forged.checked().problems == [
        "seed0: its result has scores on test that its episodes do not give (row 2: 20.0, not 0.0)"
    ]
    forged.json("seed0/result.json", lambda result: result.update(seed=7))
    assert "its result says seed 7, not 0" in forged.checked().problems[0]
    forged.json("seed0/result.json", lambda result: result.update(rank=1))
    assert "'rank' was unexpected" in forged.checked().problems[0]


def test_a_tier_cannot_be_claimed(forged: Forgery):
    forged.json("seed0/result.json", lambda result: result.update(tier="re-run"))
    verdict = forged.checked()
    assert verdict.tier == "replayed"
    assert "tier" not in verdict.results[0]


def test_another_agents_episodes_are_caught_unless_the_agent_itself_does_the_same(made: Path, forged: Forgery):
    """A board that has the same episodes under another name."""
    other = json.loads((made / "runs/submissions/near/synthetic/seed0/result.json").read_text()) | {"method": "first"}
    place = forged.board / "results" / "first" / "synthetic" / "seed0"
    place.mkdir(parents=True)
    (place / "result.json").write_text(json.dumps(other))
    line = "seed0: 3 of 3 episodes on test have the very actions of 'first', seed 0"
    refused = forged.checked()
    assert line in refused.problems
    again = forged.checked(rerun=True)
    assert again.problems == []
    assert line in again.notes


def test_an_agent_that_did_not_play_these_episodes_is_caught(forged: Forgery):
    """Episodes of one agent, sent in with the code of another."""
    code = forged.folder / "agent" / "near.py"
    code.write_text(code.read_text().replace("1.0, -1.0", "0.9, -1.0"))
    assert forged.checked().sound
    problems = forged.checked(rerun=True).problems
    assert "the agent, run again, acts otherwise" in problems[0]


PARROT = """
import glob


class Near:
    name = "near"

    def __init__(self, near=0.06):
        pass

    def agent(self, seed):
        raise SystemExit(70 + len(glob.glob(__file__.rpartition("/agent/")[0] + "/seed*")))
"""


def test_an_agent_that_is_run_again_finds_nothing_to_repeat(forged: Forgery):
    """It ends with 70 and as many folders of episodes as it finds, or is stopped where it looks for them."""
    (forged.folder / "agent" / "near.py").write_text(PARROT)
    problems = forged.checked(rerun=True).problems
    assert "it ended with code 70" in problems[0] or "agents may not" in problems[0]


def test_an_agent_that_cannot_be_run_again_is_told(forged: Forgery):
    (forged.folder / "agent" / "near.py").unlink()
    assert "the bundle lacks the agent's file near.py" in forged.checked(rerun=True).problems[0]


def test_chosen_and_hidden_seeds_are_caught(forged: Forgery):
    forged.json("bundle.json", lambda told: told.update(seeds=[1]))
    problems = forged.checked().problems
    assert "has seeds [1]; they must be 0, 1, 2" in problems[0]
    assert "seed0 is there, but not among the seeds" in problems[1]
    forged.json("bundle.json", lambda told: told.update(seeds=[0, 1, 2]))
    assert "seed2: lacks episodes.parquet" in forged.checked().problems[0]


def test_other_physics_is_told(forged: Forgery):
    forged.json("bundle.json", lambda told: told.update(physics="0" * 64))
    assert forged.checked().problems == [
        "was played with other physics than this version's; submit it again with this version"
    ]


def test_another_platform_is_held_to_outcomes_and_says_so(forged: Forgery):
    """A last bit differs everywhere; outcomes are those of the replay."""
    forged.json("seed0/provenance.json", lambda told: told["machine"].update(cpu="another"))
    forged.table(lambda table: table.assign(trace="0" * 64))
    verdict = forged.checked()
    assert verdict.problems == []
    assert "made on another platform; of 4 episodes 0 are equal bit for bit, 4 end alike" in verdict.notes[0]
    forged.table(row(2, score=20.0, success=True))
    assert "says success True" in "".join(forged.checked().problems)


class Unsafe:
    """Makes bundles that nobody's tool would."""

    def __init__(self, sound: Path, file: Path) -> None:
        with zipfile.ZipFile(sound) as archive:
            self.members = [(info, archive.read(info)) for info in archive.infolist()]
        self.file = file

    def add(self, name: str | zipfile.ZipInfo, content: bytes = b"") -> Unsafe:
        info = name if isinstance(name, zipfile.ZipInfo) else zipfile.ZipInfo(name)
        info.compress_type = zipfile.ZIP_DEFLATED
        self.members.append((info, content))
        return self

    def refused(self, into: Path) -> str:
        """Why it is refused, after nothing was written but in the folder it was to go to."""
        with zipfile.ZipFile(self.file, "w") as archive, warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Duplicate name")
            for info, content in self.members:
                archive.writestr(info, content)
        before = sorted(into.parent.rglob("*"))
        with pytest.raises(bundle.BadBundle) as caught:
            bundle.unpack(self.file, into)
        assert [path for path in sorted(into.parent.rglob("*")) if not path.is_relative_to(into)] == before
        return str(caught.value)


@pytest.fixture
def unsafe(made: Path, tmp_path: Path) -> Unsafe:
    return Unsafe(made / "near.zip", tmp_path / "unsafe.zip")


@pytest.mark.parametrize(
    "name",
    [
        "../evil.py",
        "/etc/passwd",
        "agent/../../evil.py",
        "agent\\evil.py",
        "agent/weights.pkl",
        "seed0/x.parquet",
        "C:x",
    ],
)
def test_paths_and_kinds_that_no_bundle_has_are_refused(name: str, unsafe: Unsafe, tmp_path: Path):
    assert f"a bundle has no file {name!r}" in unsafe.add(name, b"x").refused(tmp_path / "into")


def test_ways_of_packing_that_hide_sizes_are_refused(unsafe: Unsafe, tmp_path: Path):
    unsafe.add("agent/zeros.pt", bytes(2**20))
    unsafe.members[-1][0].compress_type = zipfile.ZIP_BZIP2
    assert "agent/zeros.pt is packed in a way" in unsafe.refused(tmp_path / "into")


@pytest.mark.parametrize("name", ["exp", "Exp", "rlil-0.3", "RLIL-0.1-mine", "exp\n", "first", "FIRST"])
def test_names_that_are_or_look_like_anothers_are_refused(name: str, tmp_path: Path):
    (tmp_path / "results" / "first" / "real" / "seed0").mkdir(parents=True)
    with pytest.raises(contest.BadSubmission):
        merging.check_name(name, "synthetic", tmp_path, replace=True)
    merging.check_name("first-of-mine", "synthetic", tmp_path, replace=False)


@pytest.mark.parametrize(
    "told",
    [{"machine": "x"}, {"git": ["a"]}, {"machine": {"system": "Linux", "cpu": "\ud800", "cores": 1}}, {"more": 1}],
)
def test_a_provenance_from_which_no_page_could_be_made_is_refused(told: dict[str, Any], forged: Forgery):
    forged.json("seed0/provenance.json", lambda whole: whole.update(told))
    forged.json("seed0/result.json", lambda result: result["provenance"].update(told))
    assert "in the result is not" in forged.checked().problems[0] or "text" in forged.checked().problems[0]


def test_a_text_that_would_fill_the_memory_is_refused(forged: Forgery):
    forged.table(row(2, failure="x" * 5000))
    assert "has texts of more than 1000 letters in column 'failure'" in forged.checked().problems[0]


def test_links_twins_and_strays_are_refused(made: Path, unsafe: Unsafe, tmp_path: Path):
    link = zipfile.ZipInfo("agent/link.py")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    assert "is a link" in unsafe.add(link, b"/etc/passwd").refused(tmp_path / "into")
    twin = Unsafe(made / "near.zip", unsafe.file).add("seed0/result.json", b"{}")
    assert "holds seed0/result.json twice" in twin.refused(tmp_path / "into")
    stray = Unsafe(made / "near.zip", unsafe.file).add("agent/more.py", b"")
    assert "holds agent/more.py, which its manifest has not" in stray.refused(tmp_path / "into")


def test_a_bomb_is_refused_before_it_is_unpacked(unsafe: Unsafe, tmp_path: Path):
    bomb = unsafe.add("agent/zeros.pt", bytes(bundle.LARGEST + 1))
    assert "agent/zeros.pt would unpack to too much (256 MiB)" in bomb.refused(tmp_path / "into")
    assert bomb.file.stat().st_size < 2**21


def test_a_bomb_of_many_files_is_refused(unsafe: Unsafe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bundle, "TOTAL", 1000)
    assert "would unpack to more than" in unsafe.refused(tmp_path / "into")


def test_a_changed_byte_is_refused(made: Path, unsafe: Unsafe, tmp_path: Path):
    for place, (info, content) in enumerate(unsafe.members):
        if info.filename == "seed1/result.json":
            unsafe.members[place] = (info, content.replace(b"20.0", b"19.0", 1))
    assert "seed1/result.json is not the file whose SHA-256 the manifest has" in unsafe.refused(tmp_path / "into")
    cut = tmp_path / "cut.zip"
    cut.write_bytes((made / "near.zip").read_bytes()[:-30])
    with pytest.raises(bundle.BadBundle, match="no whole zip file"):
        bundle.unpack(cut, tmp_path / "other")


def test_a_zip_of_something_else_is_named(tmp_path: Path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("bundle.json", '{"format": 1}')
    with pytest.raises(bundle.BadBundle, match="'name' is a required property"):
        bundle.unpack(tmp_path / "other.zip", tmp_path / "into")


def test_the_command_line_submits_verifies_adds_and_verifies_the_board(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    words = [
        "submit",
        f"{made}/near.py:Near",
        "--name",
        "mine",
        "--seed",
        "0",
        "--settings",
        '{"near": 0.05}',
        "--quiet",
    ]
    assert cli.main(words) == 0
    assert "mine-synthetic.zip" in capsys.readouterr().out
    assert cli.main(["leaderboard", "verify", "mine-synthetic.zip", "--rerun"]) == 0
    assert "re-run; 4 of 4 episodes equal bit for bit" in capsys.readouterr().out
    assert cli.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board"]) == 0
    assert "| `mine` |" in (tmp_path / "board" / "README.md").read_text()
    assert cli.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board"]) == 2
    assert "--replace puts this one in its place" in capsys.readouterr().err
    assert cli.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board", "--replace"]) == 0
    assert cli.main(["leaderboard", "verify", "--all", "--board", "board"]) == 0
    assert "mine, synthetic reaches, seed 0: replayed, 4 of 4 episodes" in capsys.readouterr().out
    file = tmp_path / "board/results/mine/synthetic/seed0/result.json"
    file.write_text(file.read_text().replace("0.0", "20.0", 1))
    assert cli.main(["leaderboard", "verify", "--all", "--board", "board"]) == 1
    told = capsys.readouterr().out
    assert "NOT what its episodes give" in told
    assert "table.csv differs" in told


def test_a_board_of_baselines_is_run_again(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Dice fall otherwise when only some rows are played, so that all are."""
    runs, board = str(tmp_path / "runs"), tmp_path / "board"
    assert cli.main(["run", "--method", "exp", "--record", "0", "--runs", runs, "--quiet"]) == 0
    assert cli.main(["leaderboard", "build", "--runs", runs, "--into", str(board)]) == 0
    capsys.readouterr()
    assert cli.main(["leaderboard", "verify", "--all", "--rows", "1", "--board", str(board)]) == 0
    told = capsys.readouterr().out
    assert "exp, synthetic reaches, seed 0: run again, 2 of 4 episodes, all equal" in told
    assert "random, synthetic reaches, seed 0: run again" in told
    copied = board / "results/best/synthetic/seed0"
    shutil.copytree(board / "results/exp/synthetic/seed0", copied)
    assert cli.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 1
    assert "lies in best/synthetic/seed0, but was made by exp" in capsys.readouterr().out
    shutil.rmtree(copied.parents[1])
    file = board / "results/exp/synthetic/seed0/result.json"
    file.write_text(file.read_text().replace("20.0", "19.0", 1))
    assert cli.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 1
    assert "says return 19; run again it is 20" in capsys.readouterr().out
    assert cli.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "none"]) == 2
    assert "its methods: exp, nothing, random" in capsys.readouterr().err


def test_what_cannot_be_submitted_is_said(made: Path, capsys: pytest.CaptureFixture[str]):
    for words, why in (
        (["--name", "a/b"], "the name 'a/b' is not one"),
        (["--name", "a", "--seed", "3"], "seeds are 0, 1, 2 and so on"),
        (["--name", "a", "--settings", "1"], "settings are a JSON object"),
        (["--name", "a", "--settings", "{"], "--settings is no JSON"),
    ):
        assert cli.main(["submit", f"{made}/near.py:Near", *words]) == 2
        assert why in capsys.readouterr().err
    assert cli.main(["leaderboard", "verify"]) == 2
    assert "name a submission, or give --all" in capsys.readouterr().err
