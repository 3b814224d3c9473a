"""The race at the end of a run: episodes of the policy search, one at a time."""

from typing import Any

from eutree.data import Episode
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import End, ended_episode
from eutree.interaction.seeding import Stream
from eutree.learners import Step
from eutree.policies import TreePolicy
from eutree.training.phases import Plan
from eutree.training.raced_episodes import STARTS
from eutree.training.run_state import RunState
from eutree.training.search import PolicySearch, SearchState


class Racing:
    """Runs what the policy search asks for.

    Args:
        plan: The run's seed, and its seconds.
        state: Where the run stands; what the race runs is counted and noted there.

    Attributes:
        search: The policy search; None before it begins and after its end.
        result: What the race ended with; None before.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._plan = plan
        self._state = state
        self.search: PolicySearch | None = None
        self.result: TreePolicy | None = None

    @property
    def challengers(self) -> int:
        """Trees that were put to the test so far in the race under way."""
        return 0 if self.search is None else self.search.state.tried

    def run(self, search: PolicySearch, env: GuardedEnv) -> None:
        """Run one episode of the policy search, or end it."""
        self.search, state = search, self._state
        state.gathering_begins()
        state.whole = True  # a search is stored as it stood between two stages
        won = search.state.won
        over = self._plan.seconds is not None and state.at.seconds >= self._plan.seconds
        heat = None if over else search.next_heat()
        if search.state.won > won or heat is None:
            self._note(search.state)
        if heat is None:
            self._end(search)
            return
        room = self._plan.race_steps - state.at.racing_steps
        episode = self._run_episode(*heat, env, room)
        if episode is not None:
            search.heat_run(episode)
            state.move(racing_steps=state.at.racing_steps + len(episode))
            state.note_what_was_recorded()
        elif not state.stopped:  # longer than any before: it decides nothing
            state.move(racing_steps=self._plan.race_steps)
            self._end(search)

    def _end(self, search: PolicySearch) -> None:
        self.result, self.search = search.result, None
        self._state.gathering_ends()
        tried = self._state.at.challengers + search.state.tried
        self._state.move(raced=True, evaluated_at=-1, challengers=tried)

    def _note(self, state: SearchState) -> None:
        facts = {"n_leaves": state.incumbent.n_leaves, "tried": state.tried, "won": state.won}
        self._state.note("race", facts)

    def _run_episode(
        self, tree: TreePolicy, start: int, env: GuardedEnv, room: int
    ) -> Episode | None:
        """Run a tree from one of the race's starts; None if the run or its room ends before."""
        state = self._state
        block = episode_seed(self._plan.seed, start // STARTS, Stream.RACING)
        observation = env.reset(episode_seed(block, start % STARTS))
        observations, rewards = [observation], []
        actions: list[int] = []
        terminated = truncated = False
        info: dict[str, Any] = {}
        try:
            while not (terminated or truncated):
                if state.must_stop() or len(actions) == room:
                    return None
                # The environment has the history already: its observations are the features.
                action = int(tree.actions[tree.tree.leaf_of(observation.tolist())])
                observation, reward, terminated, truncated, info = env.step(action)
                observations.append(observation)
                actions.append(action)
                rewards.append(reward)
                state.steps_of_episode += 1
                state.step_taken(Step(action, reward, observation, terminated, truncated, info))
        finally:
            state.steps_of_episode = 0
        return ended_episode(observations, actions, rewards, End(terminated, truncated, info))
