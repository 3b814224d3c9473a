"""The EU-Tree of Chernova & Veloso (2006) in one file, from NumPy and Gymnasium alone.

A person shows a task; C4.5 turns the demonstrations into a tree, whose leaves are the first states
of a Continuous U-Tree (Table 1 of the paper), which the demonstrations fill and trials refine:

    Initialization
        a single state, or the expert tree; no transitions, or the demonstrated ones   EUTree
    Data gathering phase
        determine the current state s = L(o)                                           Node.leaf
        a random action with probability epsilon, else argmax_a Q(s, a)    (Eq. 1)     EUTree.act
        perform it; store (o, a, o', r) in leaf L(o)                                   learn
        update Pr(s, a, s'), R(s, a) and Q(s, a)    (Eqs. 3 to 5)     EUTree.take, MDP.sweep
    Expansion phase, for every state (leaf node)
        q(o, a) = r + gamma V(L(o')) of all its datapoints    (Eq. 2)     EUTree.expand
        find the best split by the Kolmogorov-Smirnov test                             best_cut
        if it is significant (P = 0.01): split it, update Pr and R    EUTree.expand, EUTree.solve
        solve the MDP for Q(s, a) and V(s) = max_a Q(s, a)    (Eqs. 5, 6)     MDP.solve

What the paper leaves open is chosen as in `--preset paper`, whose trees are the same (a test shows
it). Run it: python examples/eu_tree.py. In this task it loses what it was shown (see README.md).
"""

import math
from dataclasses import dataclass, field

import gymnasium
import numpy as np

GAMMA, EPSILON, P_VALUE = 0.99, 0.05, 0.01
GATHERING_EPISODES = 20  # between two expansions
BACKUPS, PRECISION = 5, 1e-5  # of prioritized sweeping after a step; of the V that it passes on
END = -1  # the state after the last step of a task, whose value is 0


@dataclass
class Node:
    """A leaf with its number, or a test: x[feature] <= threshold goes to the first child."""

    classes: np.ndarray = None  # [A] demonstrated actions that came here
    feature: int = -1
    threshold: float = math.nan
    children: list["Node"] = field(default_factory=list)
    number: int = 0

    def leaf(self, observation):
        """Return the number of the leaf of an observation, the paper's L(o)."""
        if not self.children:
            return self.number
        return self.children[int(observation[self.feature] > self.threshold)].leaf(observation)

    def leaves(self):
        """Return the leaves below, from left to right."""
        return [leaf for child in self.children for leaf in child.leaves()] or [self]

    def mistakes(self):
        """Return how many examples of a leaf have another action than its commonest."""
        return int(self.classes.sum() - self.classes.max())


class C45:
    """Release 8 (Quinlan 1993): transitions to the ``root`` of a tree of the expert's actions."""

    def __init__(self, steps, n_actions):
        self.x, self.y = (np.array([step[i] for step in steps]) for i in (0, 1))
        self.n_actions, everything = n_actions, np.arange(len(steps))
        self.root = self.prune(self.grow(everything), everything)

    def node(self, rows, *test):
        """Return a node with these rows, which counts how often each action was taken in them."""
        return Node(np.bincount(self.y[rows], minlength=self.n_actions), *test)

    def divide(self, node, rows):
        """Return each child with its rows."""
        left = self.x[rows, node.feature] <= node.threshold
        return zip(node.children, (rows[left], rows[~left]), strict=False)

    def grow(self, rows):
        """Return the subtree of these rows; one that makes no fewer mistakes becomes a leaf."""
        node = self.node(rows)
        test = None if len(rows) < 4 or node.mistakes() == 0 else self.best_test(rows)
        if test is None:
            return node
        left = self.x[rows, test[0]] <= test[1]
        grown = Node(node.classes, *test, [self.grow(rows[left]), self.grow(rows[~left])])
        return grown if sum(n.mistakes() for n in grown.leaves()) < node.mistakes() else node

    def best_test(self, rows):
        """Return feature and threshold of the largest gain ratio among gains above the average."""
        found = [(*cut, j) for j in range(self.x.shape[1]) if (cut := self.best_gain(rows, j))]
        average = np.mean([gain for gain, *_ in found]) if found else 0.0
        good = [f for f in found if f[0] >= average - 1e-3 and f[1] > 1e-3]
        best = max(good, key=lambda cut: (cut[0] / cut[1], -cut[3]), default=None)
        return (best[3], best[2]) if best else None

    def best_gain(self, rows, j):
        """Return gain, split information and threshold of the best cut of a feature, or None."""
        order, n = rows[np.argsort(self.x[rows, j], kind="stable")], len(rows)
        values = self.x[order, j]
        left = np.eye(self.n_actions)[self.y[order]].cumsum(axis=0)  # [n, A] up to each row
        least = min(25.0, max(2.0, 0.1 * n / self.n_actions))  # on each side
        enough = (np.arange(1, n) >= least) & (n - np.arange(1, n) >= least)
        cuts = np.flatnonzero((values[:-1] < values[1:]) & enough)
        if not len(cuts):
            return None
        gains = (bits(left[-1]) - bits(left[cuts]) - bits(left[-1] - left[cuts])) / n
        at = cuts[np.flatnonzero(gains > gains.max() - 1e-10)[0]]  # the first wins ties
        gain = gains.max() - math.log2(len(cuts)) / n  # less the cost of the search
        seen = self.x[self.x[:, j] <= values[at] / 2 + values[at + 1] / 2, j]
        split = bits(np.array([at + 1.0, n - at - 1.0])) / n
        return (gain, split, float(seen.max())) if gain > 1e-10 else None

    def prune(self, node, rows):
        """Return the subtree with the fewest errors to expect: as it is, a child, or a leaf."""
        leaf = self.node(rows)
        if not node.children:
            return leaf
        children = [self.prune(*part) for part in self.divide(node, rows)]
        pruned = Node(leaf.classes, node.feature, node.threshold, children)
        largest = children[int(children[1].classes.sum() >= children[0].classes.sum())]
        branch, tree = self.expected_errors(largest, rows), self.expected_errors(pruned, rows)
        if self.expected_errors(leaf, rows) <= min(branch, tree) + 0.1:
            return leaf
        return self.prune(largest, rows) if branch <= tree + 0.1 else pruned

    def unseen_errors(self, n, e, z=0.6925):
        """Return the errors to expect beyond e of n, at 25 % confidence (Quinlan's AddErrs)."""
        if e == 0:
            return n * (1 - 0.25 ** (1 / n))
        if e + 0.5 >= n:
            return 0.67 * (n - e)
        spread = z * math.sqrt((e + 0.5) * (1 - (e + 0.5) / n) + z * z / 4)
        return n * (e + 0.5 + z * z / 2 + spread) / (n + z * z) - e

    def expected_errors(self, node, rows):
        """Return the pessimistic errors of a subtree on these rows: those seen, and AddErrs."""
        if node.children:
            return sum(self.expected_errors(*part) for part in self.divide(node, rows))
        seen = self.node(rows).mistakes()
        return seen + self.unseen_errors(len(rows), seen) if len(rows) else 0.0


def bits(weights):
    """Return the total weight of classes [..., A] times their entropy."""
    total = weights.sum(axis=-1, keepdims=True)
    return (weights * np.log2(total / np.where(weights > 0, weights, total))).sum(axis=-1)


def best_cut(x, q):
    """Return p, feature and threshold of the trial split whose sides differ most."""
    best, found, n = 0.0, (0.0, -1, 0.0), len(q)
    _, rank, counts = np.unique(q, return_inverse=True, return_counts=True)
    for feature in range(x.shape[1]):
        order = np.argsort(x[:, feature], kind="stable")
        values = x[order, feature]
        apart = np.zeros(len(counts), dtype=np.int64)  # n times (rows on the left - their share)
        for i in range(1, n):
            apart -= counts.cumsum()
            apart[rank[order[i - 1]] :] += n
            weight = int(np.abs(apart).max())  # D i (n - i)
            if values[i - 1] < values[i] and weight * weight / (i * (n - i)) > best:
                best = weight * weight / (i * (n - i))
                middle = values[i - 1] / 2 + values[i] / 2
                root = math.sqrt(i * (n - i) / n)
                k = (root + 0.12 + 0.11 / root) * weight / (i * (n - i))
                found = k, feature, float(middle if middle < values[i] else values[i - 1])
    terms = ((-1) ** (j - 1) * math.exp(-2 * (j * found[0]) ** 2) for j in range(1, 100))
    return (2 * math.fsum(terms) if found[0] > 0.3 else 1.0), *found[1:]


class MDP:
    """Counts of transitions between leaves; Pr, R, Q and V follow (Eqs. 3 to 6)."""

    def __init__(self, values, n_actions):
        self.n = np.zeros((len(values), n_actions, len(values) + 1))  # the last column: ends
        self.r = np.zeros((len(values), n_actions))  # summed rewards
        self.q = np.full((len(values), n_actions), np.nan)  # an action never tried is not chosen
        self.v = np.array(values)
        self.queue = {}  # priority of each state that waits for a backup

    def sweep(self, state):
        """Back up a state and those of highest priority (Moore & Atkeson 1993)."""
        self.queue[state] = math.inf
        backups = 0
        while self.queue and (backups := backups + 1) <= BACKUPS:
            first = max(self.queue, key=lambda s: (self.queue[s], -s))
            del self.queue[first]
            visits, loops = self.n[first].sum(axis=1), GAMMA * self.n[first, :, first]
            worth = self.r[first] + GAMMA * self.n[first, :, :-1] @ self.v - loops * self.v[first]
            tried, before = visits > 0, self.v[first]
            self.v[first] = (worth[tried] / (visits - loops)[tried]).max()  # loops to itself solved
            self.q[first, tried] = (worth + loops * self.v[first])[tried] / visits[tried]
            leading = self.n[:, :, first] / np.maximum(self.n.sum(axis=2), 1)  # Pr(s, a, first)
            priorities = leading.max(axis=1) * abs(self.v[first] - before)
            for state in set(np.flatnonzero(priorities > PRECISION)) - {first}:
                self.queue[state] = max(priorities[state], self.queue.get(state, 0.0))

    def solve(self):
        """Find Q and V exactly by policy iteration; a leaf without experience keeps its V."""
        visits = self.n.sum(axis=2)  # [S, A]
        pr, r = self.n[:, :, :-1] / np.maximum(visits, 1)[..., None], self.r / np.maximum(visits, 1)
        states, policy = np.arange(len(self.v)), None
        while True:
            self.q = np.where(visits > 0, r + GAMMA * pr @ self.v, np.nan)
            worth = np.where(visits > 0, self.q, -np.inf)
            if policy is not None and (worth.max(1) <= worth[states, policy] + 1e-9).all():
                break
            policy = worth.argmax(axis=1)
            fixed = np.where(visits.any(axis=1), r[states, policy], self.v)
            self.v = np.linalg.solve(np.eye(len(self.v)) - GAMMA * pr[states, policy], fixed)
        self.queue = {}


class EUTree:
    """A Continuous U-Tree; with demonstrations it begins with their tree and transitions."""

    def __init__(self, n_actions, demonstrations=()):
        self.history = [step for episode in demonstrations for step in episode]
        self.root, self.n_actions = Node(np.ones(n_actions)), n_actions
        if self.history:
            self.root = C45(self.history, n_actions).root
        self.leaves = self.root.leaves()
        for number, leaf in enumerate(self.leaves):
            leaf.number = number
        self.label = [int(leaf.classes.argmax()) for leaf in self.leaves]
        self.solve([0.0] * len(self.leaves))

    def solve(self, values):
        """Solve for the history in the leaves as they are; their V begins with these values."""
        self.mdp = MDP(values, self.n_actions)
        for step in self.history:
            self.take(*step)
        self.mdp.solve()

    def take(self, o, a, r, following, ended):
        """Take a transition into Pr and R; return its leaf."""
        leaf, entered = self.root.leaf(o), END if ended else self.root.leaf(following)
        self.mdp.n[leaf, a, entered] += 1
        self.mdp.r[leaf, a] += r
        return leaf

    def greedy(self, leaf):
        """Return the best action of a leaf (Eq. 1); the expert's where none was tried."""
        q = self.mdp.q[leaf]
        return self.label[leaf] if np.isnan(q).all() else int(np.nanargmax(q))

    def act(self, o):
        """Return a random action with probability epsilon, else the best."""
        if self.generator.random() < EPSILON:
            return int(self.generator.integers(self.n_actions))
        return self.greedy(self.root.leaf(o))

    def expand(self):
        """Split each leaf whose best cut is significant; solve after every split."""
        x, rewards = (np.array([step[i] for step in self.history]) for i in (0, 2))
        left = np.array([self.root.leaf(o) for o in x])
        for leaf in range(len(self.leaves)):
            entered = [END if s[4] else self.root.leaf(s[3]) for s in self.history]
            q = rewards + GAMMA * np.append(self.mdp.v, 0.0)[entered]  # Eq. 2, with o' for its o
            p, feature, threshold = best_cut(x[left == leaf], q[left == leaf])
            if p <= P_VALUE:  # both halves begin with the leaf's action and value
                node, halves = self.leaves[leaf], [Node(number=leaf), Node(number=len(self.leaves))]
                node.feature, node.threshold, node.children = feature, threshold, halves
                self.leaves = [*self.leaves[:leaf], halves[0], *self.leaves[leaf + 1 :], halves[1]]
                self.label[leaf] = self.greedy(leaf)
                self.label.append(self.label[leaf])
                self.solve([*self.mdp.v, self.mdp.v[leaf]])
        self.mdp.solve()


def episode(env, seed, act):
    """Yield the transitions (o, a, r, o', whether the task ended) of an episode."""
    o, over = np.asarray(env.reset(seed=seed)[0], np.float64), False
    while not over:
        following, r, ended, truncated, _ = env.step(a := act(o))
        following = np.asarray(following, np.float64)
        yield o, a, float(r), following, ended
        o, over = following, ended or truncated


def learn(env, episodes, demonstrations=(), seed=0):
    """Return the learner after so many episodes, and their returns; a demonstration is a list."""
    learner, returns = EUTree(int(env.action_space.n), demonstrations), [0.0] * episodes
    for k in range(episodes):
        start, chance = (np.random.SeedSequence((seed, stream, k)) for stream in (2, 3))
        learner.generator = np.random.default_rng(chance)
        for step in episode(env, int(start.generate_state(1)[0]) % 2**31, learner.act):
            learner.history.append(step)
            learner.mdp.sweep(learner.take(*step))
            returns[k] += step[2]
        if (k + 1) % GATHERING_EPISODES == 0 or k + 1 == episodes:
            learner.expand()
    return learner, returns


if __name__ == "__main__":
    env = gymnasium.make("MountainCar-v0")
    shown = [list(episode(env, seed, lambda o: 2 * int(o[1] >= 0))) for seed in range(15)]
    learner, returns = learn(env, 100, shown)
    print(f"demonstrated: {-np.mean([len(steps) for steps in shown]):.1f}")
    print(f"learned: {np.mean(returns[-20:]):.1f}, {len(learner.leaves)} leaves")
