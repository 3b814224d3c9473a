"""Tree compression that keeps its word: fewer leaves, the same decisions, and a report of both."""

from typing import TYPE_CHECKING

from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.compression.compressing import compress, compress_monotone
    from eutree.compression.episodes import CompressionReport, RealEpisodes
    from eutree.compression.imagined import ImaginedEpisodes

__all__ = ["CompressionReport", "ImaginedEpisodes", "RealEpisodes", "compress", "compress_monotone"]

__getattr__ = lazily(
    __name__,
    {
        "eutree.compression.compressing": "compress compress_monotone",
        "eutree.compression.episodes": "CompressionReport RealEpisodes",
        "eutree.compression.imagined": "ImaginedEpisodes",
    },
)
