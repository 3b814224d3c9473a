"""A policy watched while it decides: the tree, an episode player, the facts about each leaf."""

from collections import Counter
from collections.abc import Sequence
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from eutree.data import Demonstrations, Episode
from eutree.display import counted, told_apart
from eutree.policies import TreePolicy
from eutree.report.html import Pointer, Verdict, asset, head, page
from eutree.report.tree_data import SIZE_LIMIT, add_pictures, policy_features, tree_data
from eutree.report.watching import WatchedEpisode
from eutree.trees.text import definitions

if TYPE_CHECKING:
    from eutree.proof import Certificate

_SCRIPTS = ("model", "tree", "player", "details", "rules", "slices", "search", "start")


def policy_page(
    policy: TreePolicy,
    *,
    episodes: Sequence[WatchedEpisode] = (),
    demonstrations: Demonstrations | None = None,
    certificate: "Certificate | None" = None,
    title: str = "",
    file: str = "policy.json",
    size_limit: int = SIZE_LIMIT,
) -> str:
    """Return one self-contained HTML page on which the policy can be watched and questioned.

    Args:
        policy: The policy to be watched.
        episodes: Episodes of the policy to play, with or without pictures.
        demonstrations: Which demonstrated steps fell in which leaf is shown, if given.
        certificate: The proven properties of the policy are shown, if given.
        title: Heading of the page; by default the environment's id.
        file: Name of the policy's file, for the command line that repeats the changes made on the
            page and for the name of the edited file.
        size_limit: Size of the page in bytes above which pictures are left out, those of the
            last episodes first.
    """
    heading = title or (policy.environment.id if policy.environment else "A decision tree")
    sizes = counted(policy.n_leaves, "leaf"), counted(policy.schema.n_features, "feature")
    subtitle = ", ".join(sizes)
    subtitle += "".join(f", {words}" for words in _made_with(policy))
    facts = [subtitle, *definitions(policy.tree, policy.schema)]
    proven = ""
    if certificate is not None:
        from eutree.report.proof_page import certificate_section

        facts.append(str(certificate))
        proven = certificate_section(certificate)
    verdict = policy_verdict(policy, episodes, demonstrations)
    body = Template(asset("policy.html")).substitute(
        head=head(heading, verdict, facts, beside=asset("search.html")),
        certificate=proven,
        **{part: asset(f"{part}.html") for part in ("tree", "player", "details")},
    )
    data = tree_data(policy, episodes, demonstrations) | {"file": file}
    scripts = "".join(asset(f"{name}.js") for name in _SCRIPTS)
    style = asset("watch.css") + asset("policy.css")
    add_pictures(data, episodes, body + scripts + style, size_limit)
    return page(title=heading, body=body, style=style, script=scripts, data=data)


def _made_with(policy: TreePolicy) -> list[str]:
    """Return the quantities of the actions, and the arguments of the environment in a word each."""
    found = []
    for control in policy.schema.controls:
        low, high = min(control.levels), max(control.levels)
        texts = told_apart(control.levels, high - low)
        ends = f"{texts[low]} to {texts[high]} {control.unit}".rstrip()
        found.append(f"{control.name} in {len(texts)} levels from {ends}")
    arguments = policy.environment.arguments if policy.environment else {}
    for key, value in sorted(arguments.items()):
        name = key.removeprefix("n_").replace("_", " ")
        if isinstance(value, bool):
            found.append(name if value else f"no {name}")
        elif isinstance(value, int | float | str):
            found.append(f"{name} {value}")
    return found


def policy_verdict(
    policy: TreePolicy,
    episodes: Sequence[WatchedEpisode],
    demonstrations: Demonstrations | None = None,
) -> Verdict:
    """Return how the episodes went, and the leaf that has most to do with it.

    Where some fail, that is the leaf in which most of the failures end; else the one that most of
    the steps counted on the page end in.
    """
    played = [watched.episode for watched in episodes if len(watched.episode)]
    outcome = _outcome(played)
    failed = [episode for episode in played if episode.is_success is False]
    if failed:
        leaf, count = Counter(_leaves(policy, e)[-1] for e in failed).most_common(1)[0]
        many = f"{count} of {len(failed)} failures end in " if len(failed) > 1 else "it ends in "
        return [f"{outcome}; {many}", _pointer(policy, leaf)]
    if policy.leaves is not None:
        visits = policy.leaves.visits.sum(axis=1)
    else:
        shown = demonstrations.episodes if demonstrations is not None else ()
        ends = [leaf for e in (*played, *shown) for leaf in _leaves(policy, e)]
        visits = np.bincount(np.array(ends, dtype=np.int64), minlength=policy.n_leaves)
    if not visits.any():
        return [outcome or f"A tree of {counted(policy.n_leaves, 'leaf')}"]
    leaf = int(visits.argmax())
    share = f"{100 * visits[leaf] / visits.sum():.0f} % of all steps end in "
    return [f"{outcome}; {share}" if outcome else share, _pointer(policy, leaf)]


def _leaves(policy: TreePolicy, episode: Episode) -> list[int]:
    found: list[int] = policy.tree.leaf_index(policy_features(policy, episode)[:-1]).tolist()
    return found


def _outcome(played: Sequence[Episode]) -> str:
    """Return how many episodes succeed or, where that is not reported, their mean return."""
    known = [episode.is_success for episode in played if episode.is_success is not None]
    if known:
        verb = "succeeds" if len(known) == 1 else "succeed"
        return f"{sum(known)} of {counted(len(known), 'episode')} {verb}"
    if not played:
        return ""
    mean = float(np.mean([episode.undiscounted_return for episode in played]))
    return f"Mean return {mean:.4g} in {counted(len(played), 'episode')}"


def _pointer(policy: TreePolicy, leaf: int) -> Pointer:
    """Return the name of a leaf and its action, pointing at its node."""
    action = policy.schema.actions[policy.actions[leaf]]
    return Pointer(f"leaf {leaf} ({action})", f"node-{int(policy.tree.node_of_leaf[leaf])}")
