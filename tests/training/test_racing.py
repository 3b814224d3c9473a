"""Racing ends a run: the better tree wins, steps count, a kill costs an episode at most."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import eutree
from eutree.contests import Ahead
from eutree.envs.experts import careless
from eutree.errors import InvalidArgumentError, RunFolderError
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.learners.episode_buffer import transitions_of
from eutree.policy_search import climbing
from eutree.training import proposals
from eutree.training import search as search_module
from eutree.training.proposals import PROMISING, SearchSettings, key
from eutree.training.raced_episodes import Block, RacedEpisodes
from eutree.training.search import LONG, ROUNDS, PolicySearch
from eutree.world_model import WorldModel
from tests.corridor import WRONG, Corridor, policy_of

ARTEFACTS = ("policy.json", "expert.json", "curve.csv", "progress.csv", "events.jsonl",
             "checkpoint.npz", "config.json")  # fmt: skip
SHORT = {"evaluate_every": 10**6, "evaluation_episodes": 4, "seed": 3, "front_steps": 0}


@pytest.fixture(scope="module")
def env():
    return Corridor()


@pytest.fixture(scope="module")
def shown(env):
    return eutree.record(env, careless(lambda env: WRONG, 0.3), episodes=12, seed=1000)


@pytest.fixture(scope="module")
def expert():
    return WRONG


@pytest.fixture(scope="module")
def plain(env, shown, expert):
    return eutree.learn(env, demonstrations=shown, expert=expert, episodes=0, **SHORT)


def search_of(result, seed=1, **settings):
    options = {"steps": 6_000, "model_steps": 3_000, "max_leaves": 6} | settings
    data = transitions_of(result.history, result.policy.schema.n_actions)
    return PolicySearch(
        result.policy, data, SearchSettings(**options), seed=seed, max_episode_steps=10
    )


def run(search, env, *, restart_every=0, again=None):
    """Run a search to its end; every so many episodes begin anew with what is stored of it."""
    guarded, count = GuardedEnv(env), 0
    while (due := search.next_run()) is not None:
        count += 1
        if restart_every and count % restart_every == 0:
            state, episodes = search.state, search.all_episodes
            search = again()
            search.restore(state, episodes)
            continue
        tree, start = due
        search.take(run_episode(guarded, tree, episode_seed(5, start)))
    return search


@pytest.fixture(scope="module")
def searched(env, plain):
    return run(search_of(plain), env)


def test_searches_improve_a_tree(env, plain):
    """Five of five by chance: once in 32 times, were better and worse equally likely."""
    before = eutree.evaluate(plain.policy, env, episodes=100, seed=9).returns
    gains = np.array([
        eutree.evaluate(found.incumbent, env, episodes=100, seed=9).returns - before
        for found in (
            run(search_of(plain, seed, steps=2_500, model_steps=1_500), env) for seed in range(5)
        )
    ])  # fmt: skip
    assert (gains.mean(axis=1) > 0.0).all()
    # The searches had the same episodes, so their spread is that of the mean of all five.
    error = gains.mean(axis=0).std(ddof=1) / np.sqrt(100)
    assert gains.mean() - 3 * error > 1.0  # of the 2.5 that were lost


def test_a_search_keeps_its_budget_and_its_limit(searched):
    assert searched.state.won >= 1
    assert searched.incumbent.n_leaves <= 6
    assert 2_000 < searched.raced.steps == sum(map(len, searched.raced.all)) <= 6_000


@pytest.mark.parametrize("long", [LONG, (8, 16)])
def test_a_search_that_is_stored_and_restored_ends_the_same(env, plain, monkeypatch, long):
    """A kill costs the episode under way, and nothing else; where it climbs, too."""
    monkeypatch.setattr(search_module, "LONG", long)
    monkeypatch.setattr(search_module, "TELLING", 8)
    monkeypatch.setattr(climbing, "ANNEALED", 400)
    monkeypatch.setattr(climbing, "TRIES", 200)
    brief = {"steps": 1_200, "model_steps": 500}
    searched = run(search_of(plain, **brief), env)
    again = run(
        search_of(plain, **brief), env, restart_every=7, again=lambda: search_of(plain, **brief)
    )
    assert key(again.incumbent) == key(searched.incumbent)
    assert (again.raced.steps, again.state.tried) == (searched.raced.steps, searched.state.tried)
    assert again.state.chance == searched.state.chance
    assert (searched.state.round > ROUNDS) == (long != LONG)


@pytest.mark.parametrize("foretold", [True, False])
def test_few_run_where_a_model_foretells_what_the_incumbent_earns(env, plain, foretold):
    """The world model ranks challengers if it is right of the incumbent; else all of them run."""
    search = search_of(plain)
    guarded = GuardedEnv(env)
    own = [run_episode(guarded, plain.policy, episode_seed(5, k)) for k in range(12)]
    if not foretold:
        own = [replace(episode, rewards=episode.rewards - 50.0) for episode in own]
    challengers = [policy_of(0, place, 1) for place in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)]
    chosen, guesses = search._proposals.guessed(plain.policy, own, challengers, [])
    if not foretold:
        assert (chosen, guesses) == (tuple(challengers), ())
        return
    assert len(chosen) == len(guesses) == PROMISING < len(challengers)
    real = {
        key(one): eutree.evaluate(one, env, episodes=50, seed=9).mean_return for one in challengers
    }
    best = max(challengers, key=lambda one: real[key(one)])
    assert key(best) in {key(one) for one in chosen}


@pytest.mark.parametrize(("episodes", "asked"), [(12, "close"), (7, "near")])
def test_a_model_that_tells_starts_apart_says_who_is_promising(
    env, plain, monkeypatch, episodes, asked
):
    """Two models are right of the mean; on few episodes nobody knows which is closer."""
    search = search_of(plain)
    guarded = GuardedEnv(env)
    own = [run_episode(guarded, plain.policy, episode_seed(5, k)) for k in range(episodes)]
    mean = np.mean([episode.undiscounted_return for episode in own])
    challengers = [policy_of(0, place, 1) for place in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)]
    says = {"near": mean + np.arange(8.0), "close": mean - np.arange(8.0)}
    missed = {"near": np.full(episodes, 3.0), "close": np.full(episodes, 1.0)}
    proposals = search._proposals
    monkeypatch.setattr(proposals, "_models", lambda episodes: iter(says))
    monkeypatch.setattr(proposals, "_returns", lambda model, trees: says[model])
    monkeypatch.setattr(proposals, "_missed", lambda model, policy, episodes: missed[model])
    chosen, _ = proposals.guessed(plain.policy, own, challengers, [])
    assert set(chosen) == set(
        challengers[:PROMISING] if asked == "close" else challengers[-PROMISING:]
    )


def test_a_model_is_measured_from_the_starts_of_real_episodes(env, plain):
    """What a model misses is what it says of each real episode's own start."""
    search = search_of(plain)
    own = [run_episode(GuardedEnv(env), plain.policy, episode_seed(5, k)) for k in range(8)]
    (model, *_) = search._proposals._models(own)
    missed = search._proposals._missed(model, plain.policy, own)
    better = [replace(one, rewards=one.rewards + 100.0) for one in own]
    assert missed.shape == (8,)
    again = search._proposals._missed(model, plain.policy, better)
    assert again == pytest.approx(missed + 1000.0, abs=2 * missed.max())


def test_models_know_how_early_episodes_failed(env, plain, monkeypatch):
    """After long runs of a good policy, models of the last episodes alone know of no failure."""
    known = []
    monkeypatch.setattr(proposals, "MOST_KNOWN", 100)
    monkeypatch.setattr(
        proposals, "fit_world_models", lambda data, *_, **__: known.append(data) or [WorldModel]
    )
    good = run_episode(GuardedEnv(env), policy_of(0, 0.5, 1), episode_seed(5, 0))
    good = replace(good, terminated=False, truncated=True)
    monkeypatch.setattr(WorldModel, "without_noise", lambda: None)
    search = search_of(plain)
    assert search._proposals._data.terminated.any()
    list(search._proposals._models([good] * 100))
    assert len(known) == 4
    assert all(data.rewards.size <= 100 and data.terminated.any() for data in known)


def test_locked_leaves_stay_as_they_are(env, plain):
    locked = tuple(range(min(2, plain.policy.n_leaves)))
    policy = eutree.TreePolicy(
        plain.policy.tree, plain.policy.actions, plain.policy.schema, locked=locked
    )
    data = transitions_of(plain.history, policy.schema.n_actions)
    settings = SearchSettings(steps=3_000, model_steps=2_000)
    search = PolicySearch(policy, data, settings, seed=1, max_episode_steps=10)
    found = run(search, env).incumbent
    rows = plain.history.observations
    there = np.isin(policy.tree.leaf_index(rows), locked)
    assert there.any()
    decided = found.actions[found.tree.leaf_index(rows)]
    assert np.array_equal(decided[there], policy.actions[policy.tree.leaf_index(rows)][there])
    assert set(found.tree.leaf_index(rows)[there]) <= set(found.locked)


def test_a_limit_of_leaves_is_kept_whatever_it_costs(env, shown):
    large = policy_of(0, 1.0, 1, 2.0, 0, 3.0, 1, 4.0, 0, 7.0, 1)
    result = eutree.learn(
        env, demonstrations=shown, expert=large, episodes=0, race_steps=1_500, max_leaves=3, **SHORT
    )
    assert result.policy.n_leaves <= 3


@pytest.mark.parametrize("locks", [(), (0,)])
def test_what_is_cut_together_races_with_the_rest(env, plain, monkeypatch, locks):
    """They keep to the limit and to the budget; locked leaves stay as they are."""
    large = policy_of(0, 1.0, 1, 2.0, 0, 3.0, 1, 4.0, 0, 7.0, 1)
    policy = replace(large, locked=locks)
    data = transitions_of(plain.history, policy.schema.n_actions)
    settings = SearchSettings(steps=3_000, model_steps=2_000, max_leaves=3)
    search = PolicySearch(policy, data, settings, seed=1, max_episode_steps=10)
    proposed = []
    cut = proposals.Proposals.cut_together

    def noted(self, *arguments):
        proposed.extend(cut(self, *arguments))
        return iter(proposed)

    monkeypatch.setattr(proposals.Proposals, "cut_together", noted)
    found = run(search, env)
    assert 1 <= len(proposed) <= proposals.KEPT
    assert all(tree.n_leaves <= 3 + 2 * len(locks) for tree in proposed)
    rows = plain.history.observations
    for tree in proposed:
        there = np.isin(policy.tree.leaf_index(rows), locks)
        decided = tree.actions[tree.tree.leaf_index(rows)]
        assert np.array_equal(decided[there], policy.actions[policy.tree.leaf_index(rows)][there])
    assert found.raced.steps <= 3_000


def test_a_limit_of_leaves_is_kept_where_time_ends_before_the_race(env, shown):
    large = policy_of(0, 1.0, 1, 2.0, 0, 3.0, 1, 4.0, 0, 7.0, 1)
    result = eutree.learn(
        env, demonstrations=shown, expert=large, episodes=0, minutes=1e-9, race_steps=1_500,
        max_leaves=3, **SHORT
    )  # fmt: skip
    assert result.environment_steps.racing == 0
    assert 1 < result.policy.n_leaves <= 3


class ThreeStripes(Corridor):
    """Beyond 7.5 the left is right again, so that two leaves are too few."""

    def step(self, action):
        return super().step(action ^ int(self.place > 7.5))


def test_a_limit_of_leaves_of_a_race_does_not_limit_learning_before():
    """What is planned decides what is stored, and from that the race's models are fitted."""
    env = ThreeStripes()
    shown = eutree.record(env, careless(lambda env: WRONG, 0.3), episodes=12, seed=1001)
    options = {"demonstrations": shown, "expert": WRONG, "episodes": 40, **SHORT}
    free = eutree.learn(env, **options)
    raced = eutree.learn(env, race_steps=100, max_leaves=2, **options)
    limited = eutree.learn(env, max_leaves=2, **options)
    assert max(raced.policy.n_leaves, limited.policy.n_leaves) <= 2 < free.learned.n_leaves
    assert np.array_equal(raced.history.actions, free.history.actions)
    assert not np.array_equal(limited.history.actions, free.history.actions)


def test_racing_is_in_the_log_the_curve_and_the_counts(env, shown, expert, tmp_path):
    result = eutree.learn(
        env,
        demonstrations=shown,
        expert=expert,
        episodes=2,
        race_steps=1_500,
        out=tmp_path / "run",
        **SHORT,
    )
    steps = result.environment_steps
    assert 0 < steps.racing <= 1_500
    assert steps.total - steps.judging == steps.demonstrations + result.steps + steps.racing
    assert steps.judging == result.against_start.steps > 0
    assert steps.demonstrations == shown.n_transitions
    assert result.curve[-1].steps == result.steps + steps.racing
    assert result.curve[-1].n_leaves == result.policy.n_leaves
    text = (tmp_path / "run" / "events.jsonl").read_text()
    assert '"event": "race"' in text
    assert "race/tried" in (tmp_path / "run" / "progress.csv").read_text().splitlines()[0]
    assert result.challengers > 0


class KilledError(Exception):
    """Stands for whatever ends a process."""


@pytest.mark.promise(8)
def test_a_run_killed_while_racing_ends_with_the_same_bytes(env, shown, expert, tmp_path):
    options = {"demonstrations": shown, "expert": expert, "episodes": 1, "race_steps": 800}
    whole = eutree.learn(env, out=tmp_path / "whole", **options, **SHORT)
    kills, calls = 0, 0

    def kill(run):
        nonlocal calls
        calls += 1
        if calls % 25 == 0:
            raise KilledError

    while True:
        try:
            again = eutree.learn(
                env,
                out=tmp_path / "run",
                resume=True,
                checkpoint_seconds=0,
                on_progress=kill,
                **options,
                **SHORT,
            )
        except KilledError:
            kills += 1
        else:
            break
    assert kills >= 2
    assert again.policy == whole.policy
    for name in ARTEFACTS:
        ours, wanted = (tmp_path / one / name for one in ("run", "whole"))
        assert ours.read_bytes() == wanted.read_bytes(), name


@pytest.mark.promise(8)
def test_a_stop_while_what_follows_a_win_is_planned_forgets_no_event(
    env, shown, expert, tmp_path, monkeypatch
):
    """The win was stored, its event was not, and the run that went on never wrote it."""
    options = {"demonstrations": shown, "expert": expert, "episodes": 0, "race_steps": 1_500}
    eutree.learn(env, out=tmp_path / "whole", **options, **SHORT)
    struck = []

    def striking(stage):
        def strike(self, state):
            if state.won and not struck:
                struck.append(state.stage)
                raise KeyboardInterrupt
            return stage(self, state)

        return strike

    for name in ("_propose", "_climb", "_race", "_vary"):
        monkeypatch.setattr(PolicySearch, name, striking(getattr(PolicySearch, name)))
    with pytest.raises(KeyboardInterrupt):
        eutree.learn(env, out=tmp_path / "run", **options, **SHORT)
    eutree.learn(env, out=tmp_path / "run", resume=True, **options, **SHORT)
    for name in ARTEFACTS:
        ours, wanted = (tmp_path / one / name for one in ("run", "whole"))
        assert ours.read_bytes() == wanted.read_bytes(), name


def test_a_callback_follows_the_race_and_may_end_it(env, shown, expert):
    steps = []

    def count(locals_, globals_):
        steps.append(locals_["actions"][0])
        return len(steps) < 200

    result = eutree.learn(
        env,
        demonstrations=shown,
        expert=expert,
        episodes=0,
        race_steps=1_500,
        callback=count,
        **SHORT,
    )
    assert len(steps) == 200
    assert result.environment_steps.racing <= 200


def test_a_stop_while_racing_ends_within_a_step(env, shown, expert, tmp_path):
    asked = 0

    def stop():
        nonlocal asked
        asked += 1
        return asked > 300

    options = {"demonstrations": shown, "expert": expert, "episodes": 0, "race_steps": 800}
    result = eutree.learn(env, stop=stop, out=tmp_path / "run", **options, **SHORT)
    assert result.environment_steps.racing < 300
    again = eutree.learn(env, out=tmp_path / "run", resume=True, **options, **SHORT)
    assert again.policy == eutree.learn(env, **options, **SHORT).policy


@pytest.fixture(scope="module")
def ended(env, shown, expert, tmp_path_factory):
    """Return the folder of a run of one episode that has not raced."""
    folder = tmp_path_factory.mktemp("ended") / "run"
    eutree.learn(env, demonstrations=shown, expert=expert, episodes=1, out=folder, **SHORT)
    return folder


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"expert": "other"}, "expert"),
        ({"strict": True}, "strict"),
        ({"race_steps": 900}, "race"),
        ({"keep_success": True}, "keep_success"),
        ({"max_leaves": 5}, "max_leaves"),
    ],
)
def test_a_run_is_not_resumed_with_what_decides_otherwise(
    env, shown, expert, ended, tmp_path, changes, name
):
    """Once another --expert, --strict or --polish-steps was accepted, and overwrote expert.json."""
    options = {"demonstrations": shown, "expert": expert, "episodes": 1, **SHORT}
    folder = shutil.copytree(ended, tmp_path / "run")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    if "expert" in changes:
        changes = {"expert": policy_of(0, 6.0, 1)}
    with pytest.raises(RunFolderError, match=name):
        eutree.learn(env, out=folder, resume=True, **(options | changes))
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    del before[".lock"], after[".lock"]
    assert after == before


def test_a_run_that_has_raced_cannot_gather_more(env, shown, expert, tmp_path):
    options = {"demonstrations": shown, "expert": expert, "race_steps": 400, **SHORT}
    eutree.learn(env, out=tmp_path / "run", episodes=1, **options)
    with pytest.raises(RunFolderError, match="has raced after 1 episodes"):
        eutree.learn(env, out=tmp_path / "run", episodes=2, resume=True, **options)


def test_what_is_refused(env, expert):
    for options, message in (
        ({"race_steps": -1}, "race_steps"),
        ({"race_steps": 10, "episodes": 0, "expert": expert}, "race_steps needs stored"),
        ({"race_steps": 10, "steps": 5}, "race_steps must be at most steps"),
        ({"race_steps": 500, "steps": 500}, "race_steps must be less than steps, 500, without"),
        ({"race_steps": 500, "steps": 500, "expert": expert}, "race_steps must be less than"),
        ({"max_leaves": 1}, "max_leaves"),
        ({"max_leaves": 5, "method": "paper"}, "max_leaves must be None"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            eutree.learn(env, **options)
    with pytest.raises(InvalidArgumentError, match="race_steps must be 0"):
        eutree.learn(None, race_steps=1)


@pytest.mark.parametrize(("steps", "climbs"), [(16_000, True), (9_000, False)])
def test_a_race_with_steps_to_spare_begins_again_elsewhere(env, plain, monkeypatch, steps, climbs):
    """Where nothing near the incumbent is better, a tree of good episodes takes its place."""
    right = policy_of(0, 5.0, 1)
    nothing = {"planned": [], "pruned": [], "promising": None, "climbed": [right]}
    for name, found in nothing.items():
        monkeypatch.setattr(proposals.Proposals, name, lambda *_, found=found: found)
    result = replace(plain, policy=WRONG)
    found = run(search_of(result, steps=steps), env)
    assert key(found.incumbent) == key(right if climbs else WRONG)
    assert found.state.won == climbs


def test_a_challenger_that_lost_tells_the_models_where_they_were_wrong(env, plain, monkeypatch):
    """They propose again before single changes are tried, three times at most."""
    right, proposed = policy_of(0, 5.0, 1), []

    def planned(_, policy, episodes):
        proposed.append(len(episodes))
        return [right] if len(proposed) == 3 else [policy_of(0, 1.0 * len(proposed), 1)]

    monkeypatch.setattr(proposals.Proposals, "planned", planned)
    for name, found in {"pruned": [], "promising": None, "climbed": []}.items():
        monkeypatch.setattr(proposals.Proposals, name, lambda *_, found=found: found)
    monkeypatch.setattr(PolicySearch, "_better", lambda self, state, challenger, errors: beats(
        challenger, right))  # fmt: skip
    found = run(search_of(replace(plain, policy=WRONG)), env)
    assert key(found.incumbent) == key(right)
    assert len(proposed) == ROUNDS
    assert proposed == sorted(set(proposed))  # by the episodes of those that lost


def beats(challenger, other):
    yield from ()
    return key(challenger) == key(other)


@pytest.mark.parametrize(
    ("steps", "number", "limit"), [(1_000, 0, 500), (1_000, 1, 1_000), (100_000, 0, 100_000)]
)
def test_where_steps_are_short_the_first_test_leaves_half_of_them(
    plain, monkeypatch, steps, number, limit
):
    def winner(self, state):
        yield from ()
        return state.challengers[0]

    monkeypatch.setattr(PolicySearch, "_winner", winner)
    search = search_of(plain, steps=steps)
    racing = replace(search.state, stage="race", round=number, challengers=(WRONG,))
    with pytest.raises(StopIteration) as ended:
        next(search._race(racing))
    assert ended.value.value.limit == limit


@pytest.mark.parametrize("limit", range(20, 120, 9))
def test_pairs_that_the_budget_allowed_count(env, limit):
    """A look of eight pairs may be cut short in the middle."""
    raced, guarded, trees = (
        RacedEpisodes(10, grows=False),
        GuardedEnv(env),
        (WRONG, policy_of(0, 3.0, 1)),
    )
    tables, run = [], {key(tree): 0 for tree in trees}

    class Told(Ahead):
        def stopped(self, table):
            tables.append(table.copy())
            return super().stopped(table)

    contest, episode = raced.hold(Told(looks=(8,)), Block(0, limit), trees), None
    while not tables:
        try:
            tree, start = contest.send(episode)
        except StopIteration:
            break
        episode = run_episode(guarded, tree, episode_seed(5, start))
        run[key(tree)] += 1
    (table,) = tables
    assert (~np.isnan(table)).sum(axis=1).tolist() == list(run.values())
    assert table[0, 0] == raced.returns[0]
