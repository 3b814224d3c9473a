"""Tree compression that keeps its word: fewer leaves, the same decisions, and a report of both."""

from eutree.compression.compress import compress
from eutree.compression.episodes import ImaginedEpisodes, RealEpisodes
from eutree.compression.report import CompressionReport

__all__ = ["CompressionReport", "ImaginedEpisodes", "RealEpisodes", "compress"]
