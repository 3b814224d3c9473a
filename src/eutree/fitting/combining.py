"""Propose derived features: differences and ratios that make a tree of demonstrations shorter.

A tree that has to compare two numbers, ``left > right``, takes a staircase of tests. Where one
difference of features of the same unit, one ratio, or one change since the last step says it in a
single test, the demonstrations show it: at the root and on top of the staircases of C4.5's tree
that test takes away more entropy than any test of a single feature, by more bits than naming one
combination among so many costs. Of the few that take most, episodes left out decide: a combination
is proposed if every tree fitted without a fold is shorter with it, together clearly, and no worse
on the fold; or if they are better by more than chance and no longer. Where there is an environment,
playing has the last word.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, best_reductions, grow
from eutree.contests import SmallestWithin
from eutree.data import Demonstrations, derive
from eutree.data.demonstrations import taught_in, weights_in
from eutree.data.episode import CUT, allowed_in
from eutree.fitting.playing import Player, Progress, contest
from eutree.fitting.report import CLEARLY_SHORTER, Proposal
from eutree.formulas import in_formula, parse
from eutree.interaction.deriving import acting_as
from eutree.learners import fit_expert_tree
from eutree.learners.starts import FOLDS, falling_back
from eutree.policies import TreePolicy
from eutree.policies.reach import among_allowed
from eutree.schema import Schema
from eutree.trees import DecisionTree

PROPOSING = 400  # first block of episodes
MOST_PROPOSED = 3
MOST_STEPS = 10_000  # the first of the demonstrations
SCREENED_STEPS = 2_500  # of them that are looked at in each place
MOST_COMBINED = 24  # features
MOST_TRIED = 6  # combinations that episodes left out decide on, in each round
STAIRCASE = 4  # leaves below a node that one test might stand for
MOST_PLACES = 8  # such nodes, those of most leaves first
BETTER = 0.02  # of the decisions left out, and three standard errors: better
BATCH = 64  # columns that are sorted together


@dataclass(frozen=True)
class _Rows:
    """The steps of demonstrations."""

    columns: Floats  # [N, d]
    labels: Integers  # [N]
    weights: Floats  # [N]; how much each step counts
    last: Floats  # [N, d]; the features at the step before; at an episode's first step its own
    part: Integers  # [N]; the episode, or its substitute, that is left out as a whole
    n_classes: int
    allowed: Booleans | None  # [N, A]; None where no action was masked

    def with_column(self, column: Floats) -> "_Rows":
        return replace(self, columns=np.column_stack([self.columns, column]))

    def tree(self, rows: Booleans, settings: C45Settings) -> tuple[DecisionTree, Integers]:
        """Return C4.5's tree of some rows and the actions of its leaves."""
        columns, labels, weights = self.columns[rows], self.labels[rows], self.weights[rows]
        grown = grow(columns, labels, n_classes=self.n_classes, weights=weights, settings=settings)
        return grown.to_decision_tree()

    def decisions(self, rows: Booleans, settings: C45Settings) -> tuple[int, Integers]:
        """Return the leaves of C4.5's tree of some rows, and what it decides in the others."""
        tree, actions = self.tree(rows, settings)
        others = self.columns[~rows]
        if self.allowed is None:
            return tree.n_leaves, actions[tree.leaf_index(others)]
        seen, schema = self.columns[rows], Schema.anonymous(tree.n_features, self.n_classes)
        policy = falling_back(TreePolicy(tree, actions, schema), seen, self.labels[rows])
        policy = among_allowed(policy, seen, self.allowed[rows])
        return tree.n_leaves, policy.decide(others, self.allowed[~rows])

    def reductions(self, rows: Booleans, columns: Floats) -> Floats:
        """Return by how many bits the best test of each of other columns tells actions apart."""
        every = max(1, -(-int(rows.sum()) // SCREENED_STEPS))
        some = np.flatnonzero(rows)[::every]
        found = [
            best_reductions(columns[some, at : at + BATCH], self.labels[some], self.weights[some])
            for at in range(0, columns.shape[1], BATCH)
        ]
        return np.concatenate(found)


@dataclass(frozen=True)
class _Trial:
    """Trees by episodes left out."""

    leaves: Integers  # [F]; of the tree without each fold
    agreement: Floats  # [E]; share of the steps of each episode that are decided as shown

    @property
    def cost(self) -> tuple[float, float]:
        """The leaves of the trees, and among equals their errors."""
        return float(self.leaves.sum()), -float(self.agreement.mean())

    def is_better_than(self, other: "_Trial") -> bool:
        """Return whether these trees are clearly shorter and no worse, or better and no longer."""
        gain = self.agreement - other.agreement
        error = float(gain.std(ddof=1)) / math.sqrt(gain.size)
        fewer = self.leaves < other.leaves
        shorter = bool(fewer.all()) and self.leaves.sum() <= CLEARLY_SHORTER * other.leaves.sum()
        better = gain.mean() > max(BETTER, 3.0 * error)
        no_longer = self.leaves.sum() <= other.leaves.sum()
        return bool((shorter and gain.mean() >= -error) or (better and no_longer))


def propose(demonstrations: Demonstrations, settings: C45Settings) -> tuple[Proposal, ...]:
    """Return the derived features that are worth declaring, each beside those before it."""
    rows, schema = _rows(demonstrations), demonstrations.schema
    if rows is None:
        return ()
    found: list[Proposal] = []
    before, columns = _tried(rows, settings), _combined(rows, schema)
    while len(found) < MOST_PROPOSED:
        tried = {
            name: _tried(rows.with_column(columns[name]), settings)
            for name in _screened(rows, columns, settings)
        }
        good = [name for name, trial in tried.items() if trial.is_better_than(before)]
        if not good:
            break
        best = min(good, key=lambda name: tried[name].cost)
        agreed = (float(before.agreement.mean()), float(tried[best].agreement.mean()))
        wider = rows.with_column(columns.pop(best))
        everything = np.ones(len(rows.labels), dtype=bool)
        short, long = (each.tree(everything, settings)[0].n_leaves for each in (wider, rows))
        found.append(Proposal(best, (long, short), agreed))
        before, rows = tried[best], wider
    return tuple(found)


def confirm(
    proposals: Sequence[Proposal],
    demonstrations: Demonstrations,
    env: gymnasium.Env[Any, Any] | None,
    settings: C45Settings,
    *,
    episodes: int,
    seed: int,
    on_progress: Progress | None = None,
) -> tuple[tuple[Proposal, ...], int]:
    """Return proposals with how their trees play and whether to take them; and all episodes.

    Taken are as many of the first as the smallest tree has that plays within a standard error of
    the best, which is confirmed by other episodes (``eutree.contests.SmallestWithin``): each tree
    plays so many fresh episodes for the choice, and for a confirmation as many. Without an
    environment all are taken. There must be at least one.
    """
    if env is None:
        return tuple(replace(one, taken=True) for one in proposals), 0
    declared = [proposal.declaration for proposal in proposals]
    known = [derive(demonstrations, declared[:k]) for k in range(len(declared) + 1)]
    trees = [fit_expert_tree(one, settings=settings) for one in known]
    players = [Player(acting_as(env, one), seed, on_progress) for one in known]
    for player in players:
        player.begin("choosing features", len(trees) * episodes)
    rule = SmallestWithin(sizes=tuple(tree.n_leaves for tree in trees), episodes=episodes)
    winner, plays = contest(rule, list(zip(players, trees, strict=True)), PROPOSING)
    n = min(len(played.episodes) for played in plays.values())
    means = [float(plays[k].evaluation.returns[:n].mean()) for k in range(len(trees))]
    told = [
        replace(one, played=(means[k], means[k + 1]), taken=k < winner)
        for k, one in enumerate(proposals)
    ]
    return tuple(told), sum(player.episodes for player in players)


def _rows(demonstrations: Demonstrations) -> _Rows | None:
    """Return the first steps of demonstrations; None where nothing could be left out.

    Of fewer episodes than folds each fold is a part of all steps.
    """
    taught, allowed = taught_in(demonstrations), allowed_in(demonstrations)
    lengths = np.array([len(episode) for episode in demonstrations], dtype=np.int64)
    episode = np.repeat(np.arange(lengths.size), lengths)
    used = np.flatnonzero(taught != CUT)[:MOST_STEPS]
    if used.size < 2 * FOLDS:
        return None
    seen, parts = demonstrations.observations, np.unique(episode[used], return_inverse=True)[1]
    before = np.maximum(used - (np.diff(episode, prepend=-1) == 0)[used], 0)
    return _Rows(
        columns=seen[used],
        labels=taught[used],
        weights=weights_in(demonstrations)[used],
        last=seen[before],
        part=parts if parts[-1] >= FOLDS - 1 else np.arange(used.size) * FOLDS // used.size,
        n_classes=demonstrations.schema.n_actions,
        allowed=None if allowed is None else allowed[used],
    )


def _tried(rows: _Rows, settings: C45Settings) -> _Trial:
    """Return how large C4.5's trees are without a fold, and how they decide in it."""
    leaves, right = np.zeros(FOLDS, dtype=np.int64), np.zeros(len(rows.labels))
    for fold in range(FOLDS):
        left_out = rows.part % FOLDS == fold
        leaves[fold], decided = rows.decisions(~left_out, settings)
        right[left_out] = decided == rows.labels[left_out]
    return _Trial(leaves, np.bincount(rows.part, right) / np.bincount(rows.part))


def _combined(rows: _Rows, schema: Schema) -> dict[str, Floats]:
    """Return the values of each combination [N], by its declaration."""
    now, names = list(rows.columns.T), schema.feature_names
    columns = {}
    for declaration in _declarations(rows, schema):
        formula = parse(declaration.partition(" = ")[2], names)
        column = formula.compute(now, lambda j: rows.last[:, j])
        if column.min() < column.max():
            columns[declaration] = column
    return columns


def _declarations(rows: _Rows, schema: Schema) -> Iterator[str]:
    """Yield the differences, ratios and changes of the features that are quantities."""
    low, high = rows.columns.min(axis=0), rows.columns.max(axis=0)
    quantities = [
        j
        for j, feature in enumerate(schema.features)
        if low[j] < high[j]
        and not (feature.is_flag or feature.categories or set("=[]") & set(feature.name))
    ]
    if len(quantities) > MOST_COMBINED:
        told = rows.reductions(np.ones(len(rows.labels), dtype=bool), rows.columns)
        quantities = sorted(sorted(quantities, key=lambda j: -told[j])[:MOST_COMBINED])
    names = schema.feature_names
    one_sign, zeros = (low >= 0.0) | (high <= 0.0), (rows.columns == 0.0).any(axis=0)

    def declared(words: str, formula: str, *which: int) -> Iterator[str]:
        if (name := words.format(*(names[j] for j in which))) not in names:
            yield f"{name} = {formula.format(*(in_formula(names[j]) for j in which))}"

    for a, b in combinations(quantities, 2):
        if schema.features[a].unit == schema.features[b].unit:
            yield from declared("{} minus {}", "{} - {}", a, b)
        over, under = (
            (a, b) if (one_sign[b], not zeros[b]) >= (one_sign[a], not zeros[a]) else (b, a)
        )
        if one_sign[under]:  # else the quotient jumps from one end to the other
            yield from declared("{} per {}", "{} / {}", over, under)
    for j in quantities:
        yield from declared("change of {}", "{0} - last({0})", j)


def _screened(rows: _Rows, columns: dict[str, Floats], settings: C45Settings) -> list[str]:
    """Return the combinations that tell most actions apart, beyond all single features."""
    if not columns:
        return []
    names, values = list(columns), np.column_stack(list(columns.values()))
    score = np.zeros(len(names))
    for place in _places(rows, settings):
        single = rows.reductions(place, rows.columns).max()
        score += np.maximum(rows.reductions(place, values) - single - math.log2(len(names)), 0.0)
    order = np.argsort(-score, kind="stable")[:MOST_TRIED]
    return [names[at] for at in order.tolist() if score[at] > 0.0]


def _places(rows: _Rows, settings: C45Settings) -> Iterator[Booleans]:
    """Yield the rows [N] at the root of C4.5's tree and at the tops of its staircases."""
    tree, _ = rows.tree(np.ones(len(rows.labels), dtype=bool), settings)
    where = tree.leaf_index(rows.columns)
    for below in tree.largest_subtrees(MOST_PLACES, least=STAIRCASE):
        yield below[where]
