"""Tree compression that keeps its word: fewer leaves, the same decisions, and a report of both."""

from typing import TYPE_CHECKING

from eutree.compression.compress import compress
from eutree.compression.episodes import RealEpisodes
from eutree.compression.report import CompressionReport
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.compression.imagined import ImaginedEpisodes

__all__ = ["CompressionReport", "ImaginedEpisodes", "RealEpisodes", "compress"]

__getattr__ = lazily(__name__, {"eutree.compression.imagined": "ImaginedEpisodes"})
