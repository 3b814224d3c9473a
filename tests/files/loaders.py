"""Every loader of files from outside, with a valid file and the ways to damage it."""

import json
import sys
from pathlib import Path

import numpy as np

from eutree.data import Demonstrations
from eutree.data.files import DemonstrationFolder
from eutree.data.journal import recover_episode
from eutree.files import read_document
from eutree.learners import Problem, Start, UTree
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training.checkpoint import restore_checkpoint, stored_observations
from eutree.training.phases import Plan
from eutree.training.progress import progress_to_csv
from eutree.training.run import Beginning, Run
from eutree.training.run_folder import ConfigDocument
from eutree_lab.paper.runs import RunRecord
from tests.files.mutations import mutate, mutate_elements, mutate_members, mutate_records
from tests.golden.contents import METHODS

GOLDEN = Path(__file__).parents[1] / "golden" / "v2"
SECONDS = 2.0  # of the processor, that a damaged file may take


def load_edited(path):
    return TreePolicy.load(path, hand_edited=True)


def load_header(path):
    return DemonstrationFolder(path.parent)


def load_folder(path):
    return Demonstrations.load(path.parent)


def load_journal(path):
    return recover_episode(path)


def load_config(path):
    return read_document(path, ConfigDocument)


def load_experiment_run(path):
    return read_document(path, RunRecord)


def load_observations(path):
    return stored_observations(path.parent)


def unstarted(method):
    """Return a run at its start, without an environment."""
    beginning = Beginning(method, Problem(Schema.anonymous(3, 2)), Start())
    return Run(beginning, Plan(), None)


def checkpoint_loader(name):
    """Return a loader of checkpoints that also uses what it has loaded."""

    def load(path):
        run = unstarted(METHODS[name])
        restore_checkpoint(path, run)
        progress_to_csv(run.state.events, run.gathered)
        learner = run.learner
        learner.decisions()
        if isinstance(learner, UTree):
            learner.targets(np.arange(learner.history.size))
            learner.mdp.queue()
            learner.mdp.sweep(20)
            learner.update(np.random.default_rng(0))
        return run

    return load


# kind: (golden file, name it must have, loader, damages)
LOADERS = {
    "policy": ("policy.json", "policy.json", TreePolicy.load, (mutate,)),
    # Below the checksum, which stops nearly all of the above.
    "edited policy": ("policy.json", "policy.json", load_edited, (mutate,)),
    "header": ("demonstrations/demonstrations.json", "demonstrations.json", load_header, (mutate,)),
    "episode": (
        "demonstrations/episode-00000.npz",
        "episode-00000.npz",
        load_folder,
        (mutate, mutate_members),
    ),
    "journal": ("running.journal", "x.journal", load_journal, (mutate, mutate_records)),
    "csv": ("demos.csv", "demos.csv", Demonstrations.from_csv, (mutate,)),
    "run": ("run/config.json", "config.json", load_config, (mutate,)),
    "experiment-run": ("experiment-run.json", "run.json", load_experiment_run, (mutate,)),
    "observations": (
        "run/checkpoint.npz",
        "checkpoint.npz",
        load_observations,
        (mutate, mutate_members),
    ),
    **{
        f"checkpoint-{name}": (
            f"{name}/checkpoint.npz",
            "checkpoint.npz",
            checkpoint_loader(name),
            (mutate, mutate_members, mutate_elements, mutate_elements),
        )
        for name in ("run", "run-planned", "run-bounded", "run-planned-bounded")
    },
    "npz": ("demos.npz", "demos.npz", Demonstrations.from_npz, (mutate, mutate_members)),
}


def prepare(kind, folder):
    """Return where to put damaged content, the valid content, the loader and the damages."""
    golden, name, load, damages = LOADERS[kind]
    if kind == "episode":
        header = (GOLDEN / "demonstrations" / "demonstrations.json").read_bytes()
        (folder / "demonstrations.json").write_bytes(header)
    return folder / name, (GOLDEN / golden).read_bytes(), load, damages


def fuzz(kind, count, seed, folder):
    """Load ``count`` damaged files; stop the process at the first crash, hang or big allocation."""
    import random
    import signal

    from eutree.errors import FormatError

    path, valid, load, damages = prepare(kind, folder)
    path.write_bytes(valid)
    load(path)  # imports what it needs, before the limit
    limit_memory()
    signal.signal(signal.SIGPROF, lambda *_: (_ for _ in ()).throw(TimeoutError(f"{SECONDS} s")))
    refused = 0
    for number in range(count):
        rng = random.Random(f"{kind} {seed} {number}")
        content = rng.choice(damages)(valid, rng)
        path.write_bytes(content)
        try:
            within_seconds(load, path)
        except FormatError as error:
            refused += 1
            if "\n" in str(error) or not error.reason or not error.path:
                raise AssertionError(f"unclear: {error}") from error
        except BaseException:
            failed = folder.parent / f"failed-{kind}-{seed}-{number}"
            failed.write_bytes(content)
            print(f"{kind}, seed {seed}, number {number}: see {failed}", file=sys.stderr)
            raise
    return refused


def limit_memory():
    """Let this process take 1 GB more; macOS keeps no such limit, and does not say what it took."""
    import resource

    try:
        pages = Path("/proc/self/statm").read_text().split()[0]
    except FileNotFoundError:
        return
    most = int(pages) * resource.getpagesize() + 2**30
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))


def within_seconds(load, path):
    """Load a file in ``SECONDS``; a second chance is for what has compiled something."""
    import signal

    for chance in (1, 2):
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            return load(path)
        except TimeoutError:
            if chance == 2:
                raise
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    return None


if __name__ == "__main__":
    where, count, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    found = {}
    for kind in sys.argv[4:]:
        (where / kind).mkdir()
        found[kind] = fuzz(kind, count, seed, where / kind)
    print(json.dumps(found))
