"""Compiled loops of rollouts side by side: returns of challengers and of single deviations.

Apart from ``_kernels.py``, which looks at one state. A way down a tree is a chain of loads of which
each waits for the one before, with tests that no processor can foresee. Here many episodes are
under way at once, each in a *lane*. All take one step down a tree before any takes the next, and
without a branch, so their chains overlap. Each sum is taken in the order of a single episode:
results are its bits.
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers, Uint32s
from eutree.compiled import compiled, compiled_uncounted, inlined
from eutree.world_model._kernels import (
    EPISODE_STRIDE,
    ActionTree,
    Conditions,
    Episodes,
    NodeTests,
    World,
    chance,
    fitted,
    keep,
    model_leaf,
)
from eutree.world_model._kernels_formulas import derive

LANES = 64  # work done once for all lanes costs each little
# Episodes compared before a hopeless challenger may be given up.
FIRST_LOOK = 8


class Lanes(NamedTuple):
    """Episodes under way; those before the first n are, the rest is left from others."""

    states: Floats  # [L, 2 d]
    moves: Floats  # [L, d]
    nodes: Uint32s  # [d + 5, L] where the last descent in each tree has led
    actions: Integers  # [L]
    at: Integers  # [L] first entry of the table of draws that the step reads
    kinds: Integers  # [L] 0 goes on, 1 ends badly, 2 ends well
    forced: Integers  # [L] action to take instead of the policy's, -1 for none
    tasks: Integers  # [L] index into ``begins`` and ``totals`` of ``go_on``
    owners: Integers  # [L] episode
    steps: Integers  # [L] steps since the episode's start
    totals: Floats  # [L] earned in the lane
    weights: Floats  # [L] discount^steps


class PolicyTable(NamedTuple):
    """A policy tree laid out as a tree of ``World``."""

    tests: NodeTests
    sources: Integers  # [M] the node of the policy that each node is
    actions: Integers  # [M]
    levels: int  # tests on the longest way down


@compiled
def laid_out(policy: ActionTree) -> PolicyTable:
    """Return a policy tree as lanes go down it."""
    n_nodes = policy.feature.size
    features, above = np.zeros(n_nodes, dtype=np.uint32), np.zeros(n_nodes, dtype=np.uint32)
    thresholds = np.full(n_nodes, np.nan)
    sources, actions = np.zeros(n_nodes, dtype=np.int64), np.zeros(n_nodes, dtype=np.int64)
    depths = np.zeros(n_nodes, dtype=np.int64)
    known = 1
    for node in range(n_nodes):  # breadth first: the first ``known`` nodes have their sources
        source = sources[node]
        actions[node], above[node] = policy.action[source], node
        if policy.feature[source] >= 0:
            features[node], thresholds[node] = policy.feature[source], policy.threshold[source]
            sources[known], sources[known + 1] = policy.left[source], policy.right[source]
            depths[known] = depths[known + 1] = depths[node] + 1
            above[node] = known + 1
            known += 2
    tests = NodeTests(features, thresholds, above)
    return PolicyTable(tests, sources, actions, depths[n_nodes - 1])


@compiled
def empty_lanes(d: int) -> Lanes:
    """Return lanes in which nothing is under way: actions and states that lead somewhere."""
    nodes, none = np.zeros((d + 5, LANES), dtype=np.uint32), np.zeros((7, LANES), dtype=np.int64)
    return Lanes(
        np.zeros((LANES, 2 * d)), np.zeros((LANES, d)), nodes,
        none[0], none[1], none[2], none[3], none[4], none[5], none[6],
        np.zeros(LANES), np.zeros(LANES),
    )  # fmt: skip


@inlined
def step_down(tests: NodeTests, states: Floats, nodes: Uint32s, tree: int, n: int) -> None:
    """Let the first n lanes take a step down a tree, each from its node."""
    features, thresholds, above = tests
    for k in range(n):
        node = nodes[tree, k]
        nodes[tree, k] = above[node] - np.uint32(states[k, features[node]] <= thresholds[node])


@inlined
def descend(world: World, first: int, end: int, lanes: Lanes, n: int) -> None:
    """Write the leaf node of each lane's state in the trees of its action from the first on."""
    roots, levels, states, nodes = world.roots, world.levels, lanes.states, lanes.nodes
    deepest = 0
    for tree in range(first, end):
        deepest = max(deepest, levels[tree])
        for k in range(n):
            nodes[tree, k] = roots[lanes.actions[k], tree]
    # A few lanes alone would wait for each other's chains: those of all trees overlap, too.
    for level in range(deepest):
        for tree in range(first, end):
            if level < levels[tree]:
                step_down(world.tests, states, nodes, tree, n)


@inlined
def decide(policy: PolicyTable, lanes: Lanes, n: int) -> None:
    """Write the policy's leaf node in each lane and its action, or the action forced there once."""
    nodes, actions, forced = lanes.nodes, lanes.actions, lanes.forced
    for k in range(n):
        nodes[0, k] = 0
    for _ in range(policy.levels):
        step_down(policy.tests, lanes.states, nodes, 0, n)
    for k in range(n):
        actions[k] = forced[k] if forced[k] >= 0 else policy.actions[nodes[0, k]]
        forced[k] = -1


@inlined
def write_down(policy: PolicyTable, lanes: Lanes, n: int, trace: Episodes, to: int) -> None:
    """Write where each lane is before its step, to one place after the other."""
    states = lanes.states
    for k in range(n):
        for j in range(states.shape[1]):
            trace.states[to + k, j] = states[k, j]
        trace.earned[to + k] = lanes.totals[k]
        trace.node[to + k] = policy.sources[lanes.nodes[0, k]]
        trace.owner[to + k] = lanes.owners[k]


@inlined
def move(world: World, draws: Floats, lanes: Lanes, n: int) -> None:
    """Move the states of the first n lanes by a draw of the leaf's fit and its residuals."""
    rows, lines, noise, residuals = world.rows, world.lines, world.noise, world.residuals
    states, moves, nodes, at = lanes.states, lanes.moves, lanes.nodes, lanes.at
    d = moves.shape[1]
    mask = draws.size - 1
    descend(world, 0, d, lanes, n)
    for i in range(d):
        for k in range(n):
            row = rows[nodes[i, k]]
            pick = int(draws[(at[k] + i * world.apart) & mask] * noise[row, 1])
            moves[k, i] = fitted(lines, noise, row, states, k) + residuals[noise[row, 0] + pick]
    # Only now: all displacements were asked of the state before the step.
    for k in range(n):
        for i in range(d):
            states[k, d + i] = states[k, i]
            states[k, i] += moves[k, i]
        derive(world.formulas, states[k])
        for i in range(d):
            computed = i >= world.formulas.first  # and not as it was drawn
            states[k, d + i] = states[k, i] - states[k, d + i] if computed else moves[k, i]


@inlined
def end(world: World, draws: Floats, lanes: Lanes, n: int) -> None:
    """Write how the step ends in each of the first n lanes.

    One draw decides from both sides: a bad end where it is low, a good one where it is high.
    """
    rows, lines, noise, states = world.rows, world.lines, world.noise, lanes.states
    nodes, at, kinds = lanes.nodes, lanes.at, lanes.kinds
    d = states.shape[1] // 2
    mask = draws.size - 1
    descend(world, d + 3, d + 5, lanes, n)
    for k in range(n):
        draw = draws[(at[k] + d) & mask]
        kinds[k] = int(draw < chance(lines, noise, rows[nodes[d + 3, k]], states, k, draw))
    for k in range(n):
        draw = 1.0 - draws[(at[k] + d) & mask]
        row = rows[nodes[d + 4, k]]
        if kinds[k] == 0 and draw <= chance(lines, noise, row, states, k, draw):
            kinds[k] = 2


@inlined
def earn(world: World, lanes: Lanes, n: int) -> None:
    """Add the rewards of the step to the totals of the first n lanes."""
    rows, lines, noise = world.rows, world.lines, world.noise
    states, nodes, kinds = lanes.states, lanes.nodes, lanes.kinds
    d = states.shape[1] // 2
    # Most steps go on; an end's own tree is looked at only where there is one.
    descend(world, d, d + 1, lanes, n)
    for k in range(n):
        row = rows[nodes[d, k]]
        if kinds[k] > 0:
            root = world.roots[lanes.actions[k], d + kinds[k]]
            row = model_leaf(world, root, states, k)
        reward = fitted(lines, noise, row, states, k)
        lanes.totals[k] += lanes.weights[k] * reward


@inlined
def retire(conditions: Conditions, lanes: Lanes, n: int, totals: Floats) -> int:
    """Write the totals of ended lanes, close up; return how many are still under way."""
    d = lanes.moves.shape[1]
    for k in range(n):
        lanes.weights[k] *= conditions.discount
        lanes.steps[k] += 1
        lanes.at[k] += d + 1
    # Backwards: the last lane under way, which takes the place of k, was looked at before.
    for k in range(n - 1, -1, -1):
        if lanes.kinds[k] == 0 and lanes.steps[k] < conditions.horizon:
            continue
        totals[lanes.tasks[k]] = lanes.totals[k]
        n -= 1
        for j in range(2 * d):
            lanes.states[k, j] = lanes.states[n, j]
        lanes.at[k], lanes.tasks[k], lanes.steps[k] = lanes.at[n], lanes.tasks[n], lanes.steps[n]
        lanes.owners[k] = lanes.owners[n]
        lanes.totals[k], lanes.weights[k] = lanes.totals[n], lanes.weights[n]
    return n


@compiled_uncounted
def go_on(
    conditions: Conditions,
    episodes: Episodes,
    policy: PolicyTable,
    lanes: Lanes,
    begins: Integers,  # [m] recorded steps
    actions: Integers,  # [m] first action of each, -1 for the policy's own
    trace: Episodes,  # gets each step if it has room for all, those of an episode in their order
    totals: Floats,  # [m] earned before; rewards to the end are added
) -> int:
    """Run the policy from each recorded step to the end; return the steps written."""
    world, draws, _, discount = conditions
    d = episodes.states.shape[1] // 2
    writes = trace.earned.size > 0
    n, begun, written = 0, 0, 0
    # The first n lanes are under way, and the tasks before ``begun`` are in them or done.
    while n > 0 or begun < begins.size:
        while n < LANES and begun < begins.size:
            k = begins[begun]
            episode = episodes.owner[k]
            step = k - episodes.first[episode]
            for j in range(2 * d):
                lanes.states[n, j] = episodes.states[k, j]
            # The entries of the table that a step reads: d residuals and one for the end.
            lanes.at[n] = episode * EPISODE_STRIDE + step * (d + 1)
            lanes.forced[n], lanes.tasks[n], lanes.steps[n] = actions[begun], begun, step
            lanes.owners[n] = episode
            # As a power, not carried on from the steps before: paired returns must agree to the
            # bit where actions do, wherever they are taken up.
            lanes.totals[n], lanes.weights[n] = totals[begun], discount**step
            n += 1
            begun += 1
        decide(policy, lanes, n)
        if writes:
            write_down(policy, lanes, n, trace, written)
            written += n
        world.tally[0] += n
        move(world, draws, lanes, n)
        end(world, draws, lanes, n)
        earn(world, lanes, n)
        n = retire(conditions, lanes, n, totals)
    return written


@compiled
def without_room(d: int) -> Episodes:
    """Return a trace that takes nothing."""
    none = np.zeros(0, dtype=np.int64)
    return Episodes(np.zeros((0, 2 * d)), np.zeros(0), none, none, none, np.zeros(0))


@compiled
def record(
    conditions: Conditions,
    before: Episodes,
    departs: Integers,  # [E] first step of each episode to run again, -1 where there is none
    within: Integers,  # [M] node of the policy that holds all steps of a node before
    policy: ActionTree,
    trace: Episodes,  # room for E times the horizon, as in ``out``
    out: Episodes,
) -> None:
    """Run the policy's episodes: those of ``before`` as far as it acts alike, then its own."""
    d = before.states.shape[1] // 2
    begins = departs[departs >= 0]
    own = np.full(begins.size, -1)
    totals = before.earned[begins]
    lanes = empty_lanes(d)
    n_own = go_on(conditions, before, laid_out(policy), lanes, begins, own, trace, totals)
    arrange(before, departs, within, policy, trace, n_own, totals, out)


@compiled
def arrange(
    before: Episodes,
    departs: Integers,  # [E]
    within: Integers,  # [M]
    policy: ActionTree,
    trace: Episodes,
    n_own: int,
    totals: Floats,  # [m] returns of the episodes that were run again
    out: Episodes,
) -> None:
    """Write episodes: the steps of ``before`` up to a departure, then their own of the trace."""
    # Those of its own are written in the order in which lanes take them, not at the place of their
    # episode: pages of memory that nothing is written to cost nothing.
    lengths = np.zeros(out.returns.size, dtype=np.int64)
    for i in range(n_own):
        lengths[trace.owner[i]] += 1
    k, run = 0, 0
    # The first k places hold the steps alike of the episodes before e, or wait for their own.
    for e in range(out.returns.size):
        same = before.first[e + 1] if departs[e] < 0 else departs[e]
        out.first[e] = k
        k = keep(before, e, same, within, policy, out, k)
        out.returns[e] = before.returns[e]
        if departs[e] >= 0:
            out.returns[e] = totals[run]
            run += 1
        lengths[e], k = k, k + lengths[e]
    out.first[out.returns.size] = k
    places = lengths  # where the next own step of each episode goes
    for i in range(n_own):
        e = trace.owner[i]
        k = places[e]
        for j in range(out.states.shape[1]):
            out.states[k, j] = trace.states[i, j]
        out.earned[k], out.node[k], out.owner[k] = trace.earned[i], trace.node[i], e
        places[e] = k + 1


@compiled
def difference(
    conditions: Conditions,
    episodes: Episodes,
    departs: Integers,  # [E] step from which the challenger acts on its own, -1 where it never does
    challenger: ActionTree,
    hopeless: float,
    spread: float,  # from the least to the largest return
) -> tuple[int, float, float, bool]:
    """Compare a challenger with the recorded policy, in the episodes in which it acts on its own.

    Returns the number of those compared, the sums of the differences of return and of their
    squares, and whether all were compared. The rest is left out when the mean over all episodes is
    clearly below ``hopeless``: by two standard errors of the mean of the rest (of a finite
    population), and by half the spread of returns over the number compared. That second term, as in
    an empirical Bernstein bound, reckons with a rare large difference, and keeps many looks honest.
    """
    begins = departs[departs >= 0]
    n_departing = begins.size
    if n_departing == 0:
        return 0, 0.0, 0.0, True
    # enough: the sum of differences that a mean of ``hopeless`` over all episodes takes.
    enough = hopeless * episodes.returns.size
    own = np.full(n_departing, -1)
    rest = np.zeros(n_departing)
    nowhere = without_room(episodes.states.shape[1] // 2)
    policy = laid_out(challenger)
    lanes = empty_lanes(episodes.states.shape[1] // 2)
    n, total, squares, look = 0, 0.0, 0.0, FIRST_LOOK
    # The sums are of the first n; up to the next look all are run side by side, then added in turn.
    while n < n_departing:
        until = min(look, n_departing) if hopeless > -np.inf else n_departing
        now = slice(n, until)
        go_on(conditions, episodes, policy, lanes, begins[now], own[now], nowhere, rest[now])
        for i in range(n, until):
            k = begins[i]
            # Up to the step at which it departs, the challenger has earned as much as the policy.
            gain = episodes.earned[k] + rest[i] - episodes.returns[episodes.owner[k]]
            total += gain
            squares += gain * gain
        n = until
        if n == look and n < n_departing:
            # Looks grow by half, so there are few of them: each is a chance to be wrong.
            look += look // 2
            mean = total / n
            # Share of the departing episodes that is still to be compared.
            unknown = 1.0 - n / n_departing
            error = np.sqrt(max(squares / n - mean * mean, 0.0) * unknown / n)
            bound = mean + 2.0 * error + 0.5 * spread * unknown / n
            if bound * n_departing < enough:
                return n, total, squares, False
    return n, total, squares, True


@compiled
def deviations(
    conditions: Conditions,
    episodes: Episodes,
    policy: ActionTree,
    steps: Integers,  # [n]
    out: Floats,  # [n, A]
) -> None:
    """Write the gain of one other action at a step, followed by the policy, over the policy."""
    n_actions = out.shape[1]
    n_others = steps.size * (n_actions - 1)
    begins, actions = np.empty(n_others, dtype=np.int64), np.empty(n_others, dtype=np.int64)
    rest = np.zeros(n_others)
    at = 0
    for k in steps:
        for action in range(n_actions):
            if action != policy.action[episodes.node[k]]:
                begins[at], actions[at] = k, action
                at += 1
    d = episodes.states.shape[1] // 2
    lanes, nowhere = empty_lanes(d), without_room(d)
    go_on(conditions, episodes, laid_out(policy), lanes, begins, actions, nowhere, rest)
    # In the same order again: the next of ``rest`` is that of the step's next other action.
    at = 0
    for i in range(steps.size):
        k = steps[i]
        for action in range(n_actions):
            out[i, action] = 0.0
            if action != policy.action[episodes.node[k]]:
                gain = episodes.earned[k] + rest[at] - episodes.returns[episodes.owner[k]]
                out[i, action] = gain
                at += 1
