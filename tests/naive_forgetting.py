"""Slow, obvious twins of what a bounded history forgets."""

RANKS = 2**32


def shares(sizes, room):
    """Take one from the fullest reservoir, the last of them, until the rest has room."""
    left = list(sizes)
    while sum(left) > room:
        fullest = max(range(len(left)), key=lambda k: (left[k], k))
        left[fullest] -= 1
    return left


class LeafReservoirs:
    """All transitions ever seen, of which those below the bounds count as stored.

    Each is a list [name, leaf, action, rank].
    """

    def __init__(self, max_transitions):
        self.max_transitions = max_transitions
        self.seen = []
        self.bounds = {}

    def bound(self, leaf, action):
        return self.bounds.get((leaf, action), RANKS)

    def add(self, rows):
        self.seen += [list(row) for row in rows]

    def stored(self):
        return [row for row in self.seen if row[3] < self.bound(row[1], row[2])]

    def forget(self):
        if len(self.stored()) <= self.max_transitions:
            return
        cells = sorted({(row[1], row[2]) for row in self.stored()})
        ranks = {c: sorted(r[3] for r in self.stored() if (r[1], r[2]) == c) for c in cells}
        room = self.max_transitions - self.max_transitions // 8
        allowed = shares([len(ranks[cell]) for cell in cells], room)
        for cell, n in zip(cells, allowed, strict=True):
            if n < len(ranks[cell]):
                self.bounds[cell] = ranks[cell][n]

    def split(self, leaf, new_leaf, goes_right):
        """Let both halves begin anew with what is stored; forget the rest for good."""
        self.seen = self.stored()
        for row in self.seen:
            if row[1] == leaf:
                row[3] = row[3] * RANKS // self.bound(leaf, row[2])
                row[1] = new_leaf if goes_right(row[0]) else leaf
        for cell in [cell for cell in self.bounds if cell[0] == leaf]:
            del self.bounds[cell]


def kept_episodes(lengths, ranks, bound, max_transitions):
    """Return the numbers of the episodes that stay, and the new bound."""
    room = max_transitions - max_transitions // 8
    recent = [len(lengths) - 1]
    while recent[0] > 0 and sum(lengths[recent[0] - 1 :]) <= room // 2:
        recent.insert(0, recent[0] - 1)
    room -= sum(lengths[number] for number in recent)
    for number in sorted(range(recent[0]), key=lambda number: ranks[number]):
        room -= lengths[number]
        if room < 0:
            bound = min(bound, ranks[number])
            break
    older = [number for number in range(recent[0]) if ranks[number] < bound]
    return older + recent, bound
