"""Tree compression that keeps its word: fewer leaves, the same decisions, and a report of both."""

from typing import TYPE_CHECKING

from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.compression.compressing import compress, compress_monotone
    from eutree.compression.episodes import RealEpisodes
    from eutree.compression.imagined import ImaginedEpisodes
    from eutree.compression.report import CompressionReport

__all__ = ["CompressionReport", "ImaginedEpisodes", "RealEpisodes", "compress", "compress_monotone"]

__getattr__ = lazily(
    __name__,
    {
        "eutree.compression.compressing": "compress compress_monotone",
        "eutree.compression.episodes": "RealEpisodes",
        "eutree.compression.imagined": "ImaginedEpisodes",
        "eutree.compression.report": "CompressionReport",
    },
)
