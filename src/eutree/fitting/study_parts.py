"""The parts of a study: their order, what is obeyed in them, and what the page says before them."""

from typing import TYPE_CHECKING

from eutree.fitting.study_plan import StudyPlan

if TYPE_CHECKING:
    from eutree.data import Episode
    from eutree.recording import Session

CONSENT, PRACTICE, SHOWING, MAKING = "consent", "practice", "showing", "making"
WATCHING, CORRECTING, QUESTIONS, WAITING = "watching", "correcting", "questions", "waiting"
THANKS, DELETED = "thanks", "deleted"
PARTS = (
    CONSENT, PRACTICE, SHOWING, MAKING, WATCHING, CORRECTING, QUESTIONS, WAITING, THANKS,
)  # fmt: skip
READ = 2.0  # seconds in which the end of an episode is read
ACTING = ("start", "pause", "wait")
ALLOWED = {  # what a person may command in each part; in all others, nothing
    PRACTICE: ACTING,
    SHOWING: ACTING,
    WATCHING: ("start", "pause", "end", "redo"),
    CORRECTING: ACTING,
}
TOLD = {  # what the page says before a part, title and text
    PRACTICE: ("Get to know the keys", "{practice} to practise. No tree learns from them."),
    SHOWING: (
        "Now show how it is done",
        "{episodes}. Act as you would have the machine act. Failures may stay.",
    ),
    MAKING: (
        "Your tree is being made",
        "In a moment it drives in your place. Watch it: its failures come first, and its way "
        "through the tree is marked. You need not press anything.",
    ),
    CORRECTING: (
        "Now put it right",
        "The tree drives in {taken_over}. Where it is wrong hold a key to act in its place, and "
        "let go to hand back. What you let pass counts as approval.",
    ),
    QUESTIONS: ("What did you think of it?", "Leave open what you would rather not say."),
    WAITING: ("Your tree is being finished", "It learns from what you put right."),
    THANKS: (
        "Thank you",
        "Your code is {person}. Whoever knows it can have what you did deleted later. You can "
        "press Finish now.",
    ),
    DELETED: ("Deleted", "Nothing of what you did is kept. You can close this page."),
}
HEADS = {WATCHING: "Your tree drives", CONSENT: "Before you begin"}
ASKED = ("Delete what you did?", "All of it is deleted for good, and the study ends here for you.")
# Which number of the plan says how long a part is; without it the part is left out.
COUNTED = {PRACTICE: "practice", WATCHING: "watched", CORRECTING: "taken_over"}
BUTTONS = {  # of the study's own, by the part or by what is on the card
    "asked": [("stay", "Go on"), ("delete", "Delete all of it")],
    "told": [("begin", "Begin")],
    CONSENT: [("agree", "I agree"), ("decline", "I would rather not")],
    QUESTIONS: [("send", "Send")],
    THANKS: [("leave", "Finish")],
}


def buttons(card: str) -> list[tuple[str, str]]:
    """Return the names and the words of the buttons on a card."""
    return BUTTONS.get(card, [])


def is_whole(episode: "Episode") -> bool:
    """Return whether the task or its time limit ended the episode."""
    return episode.terminated or episode.truncated


class Counts:
    """Which episodes of the plan are done.

    Args:
        session: Records them.
        plan: Says how many there are to be.
    """

    def __init__(self, session: "Session", plan: StudyPlan) -> None:
        self._session, self._plan = session, plan

    @property
    def n_practised(self) -> int:
        """Episodes of practice."""
        return sum(episode.comment == PRACTICE for episode in self._session.episodes)

    @property
    def n_driven(self) -> int:
        """Whole episodes in which the tree drove and the person could take over."""
        return sum(e.by_hand is not None and is_whole(e) for e in self._session.episodes)

    def is_enough(self, part: str) -> bool:
        """Return whether a part has had all its episodes; False for one without any."""
        found = {
            PRACTICE: self.n_practised,
            SHOWING: self._session.recording.n_kept,
            CORRECTING: self.n_driven,
        }
        return part in found and found[part] >= getattr(self._plan, COUNTED.get(part, "episodes"))

    def set_practice_aside(self) -> None:
        """Let no tree learn from what was recorded so far."""
        for place, episode in enumerate(self._session.episodes):
            if episode.kept:
                self._session.recording.mark(place, kept=False, comment=PRACTICE)

    def label(self, part: str) -> str:
        """Return the name of the present episode, where it is not one that counts."""
        if part != PRACTICE:
            return ""
        return f"Practice {min(self.n_practised + 1, self._plan.practice)} of {self._plan.practice}"
