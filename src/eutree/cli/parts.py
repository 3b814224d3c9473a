"""What the commands of other distributions are made of; see ``eutree.commands`` in ``main``."""

from eutree.cli._cluster import cluster, workers_options
from eutree.cli._options import count_option, json_option, output_option, seed_option
from eutree.cli._output import Output, ProgressLine

__all__ = [
    "Output",
    "ProgressLine",
    "cluster",
    "count_option",
    "json_option",
    "output_option",
    "seed_option",
    "workers_options",
]
