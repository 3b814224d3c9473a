"""What the pages and ``--help`` say of presets and defaults is what the code has.

Each sentence is made here of the registry, of settings and of constants, and has to be on its page:
who changes a default is told which sentence to change with it.
"""

import inspect
import re
from pathlib import Path

import click
import pytest

import eutree
from eutree.c45 import C45Settings
from eutree.cli.learn import learn as learn_command
from eutree.compression import imagined
from eutree.compression.episodes import RealEpisodes
from eutree.contests import Ahead, AheadApart, rules
from eutree.distillation import DistillationSettings
from eutree.evaluation import off_policy
from eutree.learners import CORRECTED, DEFAULT, PRESETS
from eutree.learners.registry import METHODS
from eutree.learners.starts import STARTS
from eutree.policy_search import improvement, planner
from eutree.splitting import KolmogorovSmirnov, Permutation
from eutree.training import planned, proposals, run_folder, search
from eutree.training.planned import EPISODES
from eutree.world_model.ensemble import EnsembleSettings

ROOT = Path(__file__).parents[2]
NUMBERS = ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"]
NUMBERS += ["eleven", "twelve"]


def word(number: float) -> str:
    return NUMBERS[round(number)]


def percent(share: float) -> str:
    return f"{100 * share:.12g} %"


def default(function: object, name: str) -> object:
    return inspect.signature(function).parameters[name].default


plans, better = DEFAULT.planner, DEFAULT.planner.improvement
paired, apart = Ahead(), AheadApart()

SAID = {
    "learning.md": [
        f"by the returns of {default(eutree.learn_runs, 'selection_episodes')} episodes",
        f"it is judged on {default(eutree.learn_runs, 'judging_episodes'):,} others",
        f"fitted to the last {plans.max_transitions:,} transitions at most",
        f"{word(round(off_policy.FEWEST_HELD_OUT / off_policy.HELD_OUT)).capitalize()} episodes "
        "are the least of which some can be held out",
    ],
    "planning.md": [
        f"every time the history has grown by {percent(plans.growth - 1)} "
        f"(asked after {DEFAULT.gathering_episodes} episodes, or {DEFAULT.gathering_steps:,} steps "
        "if sooner):",
        f"with probability {plans.explorer_share} the explorer acts",
        f"as long as the incumbent has fewer than {plans.incumbent_first} episodes",
        f"the chance of a bad end exceeds {percent(1 - plans.pessimism)}, an *optimist* where it "
        f"exceeds {percent(1 - plans.optimism)}.",
        f"{plans.n_episodes:,} rollouts start from stored first observations, "
        f"{plans.n_explorer_episodes} for the explorer",
        f"about {plans.n_steps:,} steps together, at least {planner.FEWEST_ROLLOUTS} episodes",
        f"A threshold moves to one of {word(2 * len(improvement.SHIFTS))} places near it",
        f"({percent(better.price)} of a typical return for each leaf)",
        f"act for at least {plans.min_episodes} episodes ({apart.few} if they earn "
        f"more by {word(apart.clearly)} standard errors) or {plans.trial_steps:,} steps",
        f"at {plans.improvement.deviations:,} steps, or at so many fewer that no more are tried "
        f"than {plans.improvement.deviations * improvement.OTHERS:,}",
        f"the mean of the last {plans.memory} returns",
        f"has more than {proposals.MOST_LEAVES} leaves, what each of "
        f"{word(len(proposals._MODELS))} world models cuts it to",
        f"up to {word(search.ROUNDS)} times, as long as the incumbent is replaced (a quarter of",
        f"at the usual price of a leaf and at {word(max(proposals.DEARER))} times that",
        f"{word(proposals.VARIANTS)} variants of the incumbent",
        f"up to {search.MOST_KNOWING}). The first of the",
        f"chooses the {word(proposals.PROMISING)} challengers",
        f"its guess counts for {rules.GUESS} episodes",
        f"Both run the same {', '.join(map(str, paired.looks))} episodes",
        f"by {word(search.OF_ONE_ERRORS)} standard error after {rules.ENOUGH} episodes "
        f"({word(search.OF_MANY_ERRORS)} for a variant",
        f"is smaller and as good after {paired.most}.",
        f"If the steps end before, all {word(len(proposals._MODELS))} models",
        f"the returns to go in the last {proposals.RECENT} episodes",
        f"with lambda = {proposals.LAMBDA}.",
    ],
    "methods.md": [
        f"{planned.ENOUGH_STEPS[12]:,} at 12 features, {planned.ENOUGH_STEPS[6]:,} at six",
        f"where at least {word(planned.ENOUGH_SHOWN)} demonstrations are given",
        f"{planned.ENOUGH_STEPS[12]:,} from 12 features on, "
        f"{planned.ENOUGH_STEPS[6]:,} from six on",
    ],
    "good-for.md": [f"and {planned.ENOUGH_STEPS[6]:,} steps to spend the default is"],
    "small-trees.md": [
        f"of six features or more and {planned.ENOUGH_STEPS[6]:,} steps, of twelve or more "
        f"and {planned.ENOUGH_STEPS[12]:,}",
    ],
    "which-knobs.md": [f"`--set price={2 * better.price}` asks for twice as much as the default"],
    "compression.md": [
        f'`mode="{default(eutree.compress, "mode")}"` (default)',
        f"at `confidence={default(RealEpisodes, 'confidence')}`",
        f"in {imagined.N_STARTS * EnsembleSettings().members} imagined",
    ],
    "distillation.md": [f'`"{default(DistillationSettings, "method")}"` (default)'],
    "c45.md": [
        f'`z="{C45Settings().z}"` (release 8, default)',
        "no gap by default" if C45Settings().gap == 0.0 else "a gap by default",
    ],
    "splitting.md": [
        f'| `"{KolmogorovSmirnov().score}"` | K / c(n), c(n) the 1 % point of the largest K on '
        "noise | K, made comparable between actions with different numbers of tuples; the default",
        f"It stops after {Permutation().stop_after} draws that",
        f"a split with fewer than {Permutation().min_episodes} distinct",
        "permute whole episodes (`by_episode=True`, as in the preset `corrected`)"
        if CORRECTED.significance.by_episode
        else "by observation",
    ],
    "many-machines.md": [f"{default(eutree.learn_runs, 'n_jobs')}, the default, is one for each"],
}

HELP = {
    "episodes": [f"{EPISODES} where no other budget is given"],
    "checkpoint_seconds": [
        "saving takes at most a twentieth" if run_folder.SHARE == 20 else "another share"
    ],
    "preset": sorted(PRESETS),
    "method": ["planning, distilled-dqn, u-tree, ...", "between the first two"],
    "start": [f"{', '.join(STARTS[:-1])} or {STARTS[-1]}"],
}


def plain(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("page", SAID)
def test_the_page_says_what_is_so(page: str) -> None:
    text = plain((ROOT / "docs" / page).read_text())
    missing = [sentence for sentence in SAID[page] if plain(sentence) not in text]
    assert missing == [], f"docs/{page} does not say (any more) what the code does"


@pytest.mark.parametrize("name", HELP)
def test_the_help_says_what_is_so(name: str) -> None:
    (option,) = [p for p in learn_command.params if p.name == name]
    assert isinstance(option, click.Option)
    text = plain(option.help or "")
    assert [words for words in HELP[name] if words not in text] == []


def test_what_is_named_in_the_help_exists() -> None:
    assert DEFAULT.name == "planning"
    assert PRESETS["default"] is DEFAULT
    assert {"planning", "distilled-dqn", "u-tree"} <= METHODS.keys()
    options = {p.name: p.help for p in learn_command.params if isinstance(p, click.Option)}
    named = re.findall(r"[a-z-]+", (options["preset"] or "").partition(":")[2])
    words = {"literal", "the", "default", "of", "--offline"}
    assert set(named) - words <= PRESETS.keys()
