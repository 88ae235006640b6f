"""The steps that rebuild everything that depends on the physics, in order (docs/rebuild.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

DATA = "dextron_bench/data"
SPLITS = f"{DATA}/splits-*.parquet"
SEEDS = "0 1 2"
WEIGHTS = "baselines/weights"


@dataclass(frozen=True, slots=True)
class Step:
    """One step: commands of `dextron-bench`, what they read, and what they make.

    `needs` and `makes` are patterns of files below the checkout; `copies` are files of the folder of runs and their
    places in the checkout. `publishes` are labels with a source, such as rl/real, that go to the leaderboard. In a
    command, {runs} is the folder of runs, and words with a `*` are patterns of files.
    """

    name: str
    commands: tuple[str, ...]
    needs: tuple[str, ...] = ()
    makes: tuple[str, ...] = ()
    copies: tuple[tuple[str, str], ...] = ()
    publishes: tuple[str, ...] = ()


def _search(reaches: str, rows: int) -> Step:
    database = f"mc/{reaches}/seed0/experts-{reaches}"
    copies = tuple((database + end, f"{DATA}/experts-{reaches}{end}") for end in (".parquet", ".json"))
    command = f"data mc --reaches {reaches} --rows {rows} --seed 0 --runs {{runs}}"
    return Step(f"experts-{reaches}", (command,), copies=copies)


def _splits(reaches: str) -> Step:
    """The splits of a source; the catalogue is rewritten by every source, so it is no part of what a step makes."""
    command, needs = f"data splits --reaches {reaches} --into {DATA}", ()
    if reaches != "minjerk":
        database = f"{DATA}/experts-{reaches}.parquet"
        command, needs = (
            f"{command} --database {database} --runs {{runs}}",
            (database, f"{DATA}/experts-{reaches}.json"),
        )
    return Step(f"splits-{reaches}", (command,), needs, (f"{DATA}/splits-{reaches}.parquet",))


def _bottles(reaches: str) -> Step:
    """The splits under the tracks that change the bottle."""
    command = f"data splits --reaches {reaches} --bottles --into {DATA} --runs {{runs}}"
    return Step(
        f"bottles-{reaches}",
        (command,),
        (f"{DATA}/splits-{reaches}.parquet",),
        (f"{DATA}/bottles-{reaches}.parquet",),
    )


def _run(label: str, method: str, reaches: str, seeds: str = "0", needs: tuple[str, ...] = ()) -> Step:
    """A run of a method on all splits that rank methods, with its training."""
    command = f"run --method {method} --reaches {reaches} --seed {seeds} --runs {{runs}}"
    name = f"{label}/{reaches}"
    return Step(name, (command,), (f"{DATA}/splits-{reaches}.parquet", *needs), publishes=(name,))


def _quick(label: str, flags: str, reaches: str, seeds: str = "0", needs: tuple[str, ...] = ()) -> Step:
    """A run with a fifth of the paper's budget."""
    return _run(f"{label}-quick", f"{flags} --preset quick", reaches, seeds, needs)


def _experts(reaches: str, subjects: str = "") -> Step:
    """EXP on every split but `train`, whose experts the search has played: it shows that each row can be solved."""
    splits = f"val test unseen-reach {subjects} hard open"
    return replace(
        _run("exp", "exp", reaches),
        commands=(f"run --method exp --reaches {reaches} --split {splits} --runs {{runs}}",),
    )


LEARNERS = {  # By label: the flags of the method.
    "bc": "bc",
    "rl": "rl",
    "rl-hold40": "rl --hold 40",
    "rlil-0.1": "rlil --dur 0.1",
    "rlil-0.3": "rlil --dur 0.3",
}
TENTH = {f"{method}-tenth": f"{method} --preset tenth" for method in ("rlpd", "dagger")}  # By label: their flags.
SHOWN = {  # By label: the flags of the learners whose episodes may become recordings that ship, besides SOR.
    **{label: LEARNERS[label] for label in ("bc", "rl-hold40", "rlil-0.1", "rlil-0.3")},
    **TENTH,
    "stopping": "stopping",
}
RANKED = (("real", SEEDS), ("synthetic", "0"))  # Sources that rank methods, and the seeds of learners there.
UNDER_TRACKS = ("reflex", "rlil-0.1", "stopping")  # The rule, the paper's best method, and the one that leads.
RULES = ("reflex", "nothing", "random")
SIM = f"{WEIGHTS}/sim-0.1/minjerk/*"
SIM_QUICK = f"{WEIGHTS}/sim-0.1-quick/minjerk/*"


def _success(reaches: str, rows: int, epochs: int, labels: tuple[str, ...]) -> Step:
    """The success model, trained on episodes of the experts and of policies that fail often and seldom."""
    policies = [f"{WEIGHTS}/{label}/{reaches}/*.safetensors" for label in labels]
    data = f"success data --reaches {reaches} --rows {rows} --policies {' '.join(policies)} --runs {{runs}}"
    train = f"success train --reaches {reaches} --epochs {epochs} --runs {{runs}}"
    copies = ((f"success/{reaches}/seed0/model.safetensors", f"{DATA}/success-{reaches}.safetensors"),)
    return Step(f"success-{reaches}", (data, train), (f"{DATA}/splits-{reaches}.parquet", *policies), copies=copies)


def _show(method: str) -> str:
    return f"eval --method {method} --reaches synthetic --seed 0 --split test --runs {{runs}}/show"


STEPS: tuple[Step, ...] = (
    _search("real", 10_000),
    _search("synthetic", 6_000),
    *map(_splits, ("real", "synthetic", "minjerk")),
    *map(_bottles, ("real", "synthetic")),
    _experts("real", "unseen-subject"),
    _experts("synthetic"),
    *(_run(name, name, reaches) for reaches in ("real", "synthetic") for name in RULES),
    *(_run(name, name, "minjerk") for name in ("nothing", "random")),
    _quick("sim-0.1", "sim", "minjerk", SEEDS),
    *(_quick(label, flags, "real", SEEDS) for label, flags in LEARNERS.items()),
    _quick("sor", "sor", "real", SEEDS, (SIM_QUICK,)),
    *(_quick(label, flags, "synthetic") for label, flags in LEARNERS.items()),
    _quick("sor", "sor", "synthetic", needs=(SIM_QUICK,)),
    *(_run("stopping", "stopping", reaches, seeds) for reaches, seeds in RANKED),
    _run("stopping-generated2000", "stopping --generated 2000", "real", SEEDS),
    _run("stopping-windows", "stopping --labels windows", "real", SEEDS),
    *(_run(label, flags, reaches, seeds) for label, flags in TENTH.items() for reaches, seeds in RANKED),
    _run("dagger", "dagger", "real", SEEDS),
    _run("sim-0.1", "sim", "minjerk", SEEDS),
    *(_run(label, flags, "real", SEEDS) for label, flags in LEARNERS.items()),
    _run("rlil-0.1-2q", "rlil --dur 0.1 --critics 2", "real"),  # the seed in which RLIL 0.1 diverges
    _run("sor", "sor", "real", SEEDS, (SIM,)),
    *(_run(label, flags, "synthetic") for label, flags in LEARNERS.items()),
    _run("sor", "sor", "synthetic", needs=(SIM,)),
    _success("real", 4_000_000, 30, ("bc", "rl-hold40", "rlil-0.1")),
    _success("synthetic", 1_000_000, 30, ("bc", "rl-hold40", "rlil-0.1")),
    *(_run("omega", "omega", r, needs=(f"{DATA}/success-{r}.safetensors",)) for r in ("real", "synthetic")),
    Step(
        "recordings",
        (
            "run --method exp --split test --runs {runs}/show",
            *map(_show, (*SHOWN.values(), "sor")),
            "recordings choose --runs {runs}/show --method exp rlil-0.1 sor stopping --into recordings",
        ),
        needs=(
            SPLITS,
            f"{DATA}/success-synthetic.safetensors",
            SIM,
            *(f"{WEIGHTS}/{label}/synthetic/seed0.safetensors" for label in SHOWN),
        ),
        makes=("recordings/*.rrd",),
    ),
    Step(
        "figures",
        (
            "figures --reaches real --into docs/pictures",
            "windows reflex stopping --reaches real --into docs/pictures/windows-real.png",
            "windows stopping reflex --reaches real --rows 200 --failed --into docs/pictures/failures-real.png",
        ),
        needs=(f"{DATA}/*", "leaderboard/results/*/*/*/*.json", f"{WEIGHTS}/stopping/real/seed0.safetensors"),
        makes=tuple(f"docs/pictures/{name}.png" for name in ("fig*", "h*", "windows-real", "failures-real")),
    ),
    Step(
        "tracks",
        (f"leaderboard tracks --method {' '.join(UNDER_TRACKS)}",),
        needs=(SPLITS, f"{DATA}/bottles-*", *(f"{WEIGHTS}/{label}/*/*.safetensors" for label in UNDER_TRACKS)),
    ),
    Step(
        "board",
        ("leaderboard build",),
        needs=("leaderboard/results/*/*/*/*.json", "recordings/*.rrd"),
        makes=("leaderboard/table.*", "leaderboard/index.html", "leaderboard/README.md", "leaderboard/*.png"),
    ),
)
