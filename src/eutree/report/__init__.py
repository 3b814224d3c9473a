"""Self-contained HTML pages: the report of a run, a policy watched while it decides."""

from eutree.report.demonstrations_page import (
    DemonstrationFigures,
    demonstration_figures,
    demonstrations_page,
)
from eutree.report.policy_page import policy_page
from eutree.report.run_folder_report import report_of_run
from eutree.report.run_page import CHANGES_ID, Headline, RunReport, Table, WatchedTree, run_page
from eutree.report.watching import WatchedEpisode, watch

__all__ = [
    "CHANGES_ID", "DemonstrationFigures", "Headline", "RunReport", "Table", "WatchedEpisode",
    "WatchedTree", "demonstration_figures", "demonstrations_page", "policy_page", "report_of_run",
    "run_page", "watch",
]  # fmt: skip
